import base64
import json
import shutil
import subprocess
import zlib
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest
from steerclear.env.record import find_violations, read_meta
from steerclear.experiments.encounters.replay import records_with_and_without
from steerclear.experiments.encounters.scenarios import draw
from steerclear.experiments.encounters.scene import Conditions
from steerclear.experiments.replay_html import SCRIPTS, at_one_radius, game_title, pack, write_replay
from steerclear.shield.exceptions import ConfigError

NODE = shutil.which("node")


class Page(HTMLParser):
    """Collects the elements of a page, whatever it refers to, and the text of its scripts."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.links, self.scripts = [], set(), [], {}
        self._script = None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if tag not in ("meta", "input", "link", "img", "br"):
            self.open.append(tag)
        self.ids.add(attrs.get("id"))
        self.links += [attrs[name] for name in ("src", "href") if name in attrs]
        if tag == "script":
            self._script = attrs.get("id", "code")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        self._script = None

    def handle_data(self, data):
        if self._script is not None:
            self.scripts[self._script] = self.scripts.get(self._script, "") + data


def games_in(path):
    return json.loads(Page(path.read_text()).scripts["data"])["games"]


def decode(game):
    """Read the embedded numbers as replay_html.py describes them, independently of the page's own reader."""
    content = base64.b64decode(game["data"])
    content = zlib.decompress(content)
    codes, values = {}, {}
    for column in game["columns"]:
        kind = np.dtype(f"<u{column['bits'] // 8}")
        series = column["length"] // max(column["rows"], 1)
        rows = np.frombuffer(content, kind, column["length"], column["start"]).reshape(series, column["rows"])
        if column["against"] == "previous":
            rows = np.cumsum(rows, axis=1, dtype=kind)
        elif column["against"]:
            rows = rows + codes[column["against"]]
        codes[column["name"]] = rows
        numbers = rows * column.get("scale", 1) + column.get("offset", 0)
        values[column["name"]] = np.where(rows == column.get("nan", -1), np.nan, numbers)
    return values


def angle_error(a, b):
    return np.abs((a - b + 180.0) % 360.0 - 180.0)


def test_the_page_holds_the_record(game_record, tmp_path):
    (game,) = games_in(write_replay(game_record, tmp_path / "a.html"))
    values = decode(game)
    record = game_record
    np.testing.assert_allclose(values["position"].T.reshape(61, 4, 2), record["position"], atol=1e-3)
    np.testing.assert_allclose(values["flag_position"].T.reshape(61, 2, 2), record["flag_position"], atol=1e-3)
    np.testing.assert_allclose(values["speed"].T, record["speed_mps"], atol=1e-4)
    assert angle_error(values["heading"].T, record["heading_deg"]).max() < 0.003
    bits = values["bits"].T.astype(int)
    for mask, name in ((1, "has_flag"), (2, "is_tagged"), (4, "oob")):
        np.testing.assert_array_equal(bits & mask != 0, record[name])
    np.testing.assert_array_equal(values["reason"].T, record["reason"])
    np.testing.assert_array_equal(values["intervened"].T != 0, record["intervened"])
    np.testing.assert_allclose(values["safety_margin"].T, record["safety_margin_m"], atol=1e-3)
    for name in ("nominal", "filtered"):
        usable = np.isfinite(record[name]).all(axis=-1)
        np.testing.assert_array_equal(np.isfinite(values[f"{name}_speed"].T), usable)
        np.testing.assert_allclose(values[f"{name}_speed"].T[usable], record[name][usable][:, 0], atol=1e-4)
        assert angle_error(values[f"{name}_heading"].T[usable], record[name][usable][:, 1]).max() < 0.003
    assert game["captures"] == [[0, 0, 0], [40, 1, 0]]
    np.testing.assert_allclose(game["violations"], record["violations"], atol=1e-3)
    assert game["meta"]["reason_names"] == read_meta(record)["reason_names"]
    assert game["meta"]["obstacles"]["circle"] == [[3.0, [40.0, 8.0]]]


def test_the_page_is_whole_and_loads_nothing(game_record, tmp_path):
    text = write_replay(game_record, tmp_path / "deep" / "a.html").read_text()
    page = Page(text)
    assert page.open == []
    assert page.links == []
    assert "@@" not in text
    assert "http://" not in text
    assert "https://" not in text
    for nominal in ("play", "panes", "clock", "speed", "trail", "keys"):
        assert nominal in page.ids
    asked = {piece.split('"')[0] for call in ("byId", "click") for piece in page.scripts["code"].split(f'{call}("')[1:]}
    assert len(asked) > 12
    assert asked <= page.ids
    for part in SCRIPTS:
        assert (files("steerclear.experiments") / "templates" / part).read_text() in text


def test_texts_from_a_record_cannot_break_out_of_the_page(game_record, tmp_path):
    evil = "</script><script>alert(1)</script>"
    meta = {**read_meta(game_record), "policies": {"blue": evil, "red": "@@STYLE@@"}}
    record = {**game_record, "meta": np.array(json.dumps(meta))}
    page = Page(write_replay(record, tmp_path / "a.html", title=evil).read_text())
    assert set(page.scripts) == {"data", "code"}
    assert page.open == []
    assert json.loads(page.scripts["data"])["games"][0]["meta"]["policies"]["blue"] == evil


def test_several_games_are_named_apart_and_share_one_own_team(game_record, tmp_path):
    off = {**game_record, "meta": np.array(json.dumps({**read_meta(game_record), "shielded": []}))}
    red = {**game_record, "meta": np.array(json.dumps({**read_meta(game_record), "shielded": ["agent_2"]}))}
    with pytest.raises(ConfigError, match="no record to replay"):
        write_replay([], tmp_path / "a.html")
    games = games_in(write_replay([off, game_record, game_record], tmp_path / "a.html"))
    assert [game["title"] for game in games] == [
        "medium – easy, shield off",
        "2. medium – easy, shield on",
        "3. medium – easy, shield on",
    ]
    assert {game["own_team"] for game in games} == {0}
    assert {game["own_team"] for game in games_in(write_replay([off, red], tmp_path / "b.html"))} == {1}


def test_a_game_without_a_shield_counts_hits_at_the_radius_of_the_other(game_record):
    meta = read_meta(game_record)
    off = {**game_record, "meta": np.array(json.dumps({**meta, "shielded": [], "separation_m": 2.5}))}
    on = {**game_record, "meta": np.array(json.dumps({**meta, "shielded": ["agent_0"], "separation_m": 8.0}))}
    shown, kept = at_one_radius([off, on])
    assert (read_meta(shown)["separation_m"], kept) == (8.0, on)
    np.testing.assert_array_equal(shown["violations"], find_violations(off["position"], 8.0))
    assert at_one_radius([off]) == [off]


READER = """
const { readFileSync } = require("fs");
const game = JSON.parse(readFileSync(0, "utf8"));
Game.open(game).then((opened) => {
  const series = {};
  for (const [name, values] of Object.entries(opened.values)) series[name] = Array.from(values);
  const { violations, changes } = opened.marks;
  console.log(JSON.stringify({ series, violations, changes, score: opened.score(50), half: opened.pose(0, 3, 0.5) }));
});
"""


@pytest.mark.skipif(NODE is None, reason="the page's own reader runs in node where there is one")
def test_the_pages_own_reader_agrees(game_record):
    game = {**pack(game_record, "a game"), "own_team": 0}
    reader = (files("steerclear.experiments") / "templates" / "replay_data.js").read_text() + READER
    answer = subprocess.run([NODE, "-e", reader], input=json.dumps(game), capture_output=True, text=True, check=True)
    read = json.loads(answer.stdout)
    for name, values in decode(game).items():
        numbers = np.array([np.nan if value is None else value for value in read["series"][name]])
        np.testing.assert_allclose(numbers, values.ravel(), rtol=1e-6, atol=1e-5)
    assert read["violations"] == pytest.approx(0.1 * np.unique(game_record["violations"][:, 0]))
    assert read["changes"] == pytest.approx([1.0, 3.0])
    assert read["score"] == [1, 0]
    middle = game_record["position"][3:5, 0].mean(axis=0)
    assert [read["half"]["x"], read["half"]["y"]] == pytest.approx(middle, abs=1e-3)


PANE = """
const game = (catchRadius, seed) => ({ meta: { catch_radius_m: catchRadius, seed } });
const long = shortened("easy – /home/us/our_long_entry_of_2026_final.zip, shield off");
console.log(JSON.stringify([countText(1, "boat"), countText(6, "boat"), hasFlags(game(10)), hasFlags(game(0)), long]));
"""


@pytest.mark.skipif(NODE is None, reason="the page's own words are made in node where there is one")
def test_the_page_counts_in_words_knows_a_game_from_an_encounter_and_cuts_no_state_off():
    pane = (files("steerclear.experiments") / "templates" / "replay_pane.js").read_text() + PANE
    answer = subprocess.run([NODE, "-e", pane], capture_output=True, text=True, check=True)
    assert json.loads(answer.stdout) == ["1 boat", "6 boats", True, False, "easy – our_long…final.zip, shield off"]


def test_an_encounter_is_named_by_its_filter_and_no_seed_is_made_up():
    scenes = draw("head_on", "heron", "heron", Conditions(), 0, 0, 1)
    records = records_with_and_without(scenes, "parabolic", Conditions(), "head_on 0")
    assert [game_title(read_meta(record)) for record in records] == [
        "head_on 0, filter parabolic",
        "head_on 0, no filter",
    ]
    assert "unknown" not in (files("steerclear.experiments") / "templates" / "replay_pane.js").read_text()
