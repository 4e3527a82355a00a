"""Sets from which the shield saves no boat: beside that of reachability, which shares only the boats, and as played."""

import json
import math

import numpy as np
import pytest
from commands import run
from json_keys import KEYS, undocumented
from steerclear.experiments.docs import write_pages
from steerclear.experiments.reach import sets
from steerclear.experiments.reach.pages import sets_goals
from steerclear.experiments.reach.sets import RATIO_GOAL, PlayedSet, compare_pair, games_lost, play_job, values_m
from steerclear.shield import ShieldConfig
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tables.areas import area_m2
from steerclear.shield.tables.files import load_table
from steerclear.shield.tables.margin import full_thrust_state

RADIUS_M = 2.5
BARE = ShieldConfig(separation_m=RADIUS_M, buffer_m=0.0)
HEAD_ON = (180.0, 2.0, 2.0)
BOATS = ["--own", "heron", "--other", "heron"]


@pytest.fixture(scope="module")
def heron():
    return load_table("heron", "heron")


@pytest.fixture
def few(monkeypatch):
    """One pair of speeds, one heading, few positions and short games."""
    settings = {"HEADINGS_DEG": (180.0,), "SPEED_SHARES": ((1.0, 1.0),), "PLAYED_RANGES": 40, "PLAYED_BEARINGS": 12}
    for name, value in {**settings, "LONGEST_S": 6.0}.items():
        monkeypatch.setattr(sets, name, value)


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 180.0])
def test_the_manoeuvre_certificate_gives_up_where_reachability_does(heron, heading_deg):
    pair = compare_pair(heron, BARE, heading_deg, 2.0, 2.0)
    published = area_m2(heron, RADIUS_M, heading_deg, 2.0, 2.0)
    assert pair.reach_m2 == pytest.approx(published, rel=0.02)
    assert pair.shield_m2 == pytest.approx(published, rel=0.06)
    assert pair.missed_m2 <= 0.02 * pair.reach_m2


def test_opponents_that_only_hold_their_course_leave_a_smaller_set_that_misses_what_the_table_calls_lost(heron):
    tame = ShieldConfig(separation_m=RADIUS_M, buffer_m=0.0, adversary_horizon_s=0.0)
    pair = compare_pair(heron, tame, 90.0, 2.0, 2.0)
    assert math.pi * RADIUS_M**2 <= pair.shield_m2 < pair.reach_m2
    assert pair.missed_m2 >= pair.reach_m2 - pair.shield_m2 - 1e-9
    assert pair.ratio <= RATIO_GOAL
    assert not {bar["name"]: bar["met"] for bar in sets_goals([pair])}["set the shield misses, %, largest"]


def compared(file, *more):
    """Content of the JSON of ``reach compare``."""
    file.unlink(missing_ok=True)
    result = run("reach", "compare", *BOATS, "--json", file, *more)
    assert result.exit_code == 0, result.output
    return json.loads(file.read_text())


def test_a_shield_that_looks_up_the_table_is_not_judged_by_what_it_misses(tmp_path, few):
    for model, looks_up in (("value_table", True), ("turning_circle", False)):
        chosen = ("--shield-set", f"opponent_model={model}", "--shield-set", "table_margin_m=0")
        content = compared(tmp_path / "sets.json", *chosen)
        assert content["looked_up"] is looks_up
        assert ({bar["met"] for bar in content["goals"] if "misses" in bar["name"]} == {None}) is looks_up
        write_pages([content], tmp_path)
        assert ("looks opponents up in this very table" in (tmp_path / "unsafe_sets.md").read_text()) is looks_up


def test_the_command_writes_documented_json_that_becomes_a_page(tmp_path, few):
    content = compared(tmp_path / "sets.json", "--shield-set", "straight_horizon_s=5")
    assert undocumented(content, KEYS["reach compare"]) == []
    told = {"own": "heron", "other": "heron", "radius_m": RADIUS_M, "shield": {"straight_horizon_s": 5}}
    assert content["settings"] == told
    write_pages([content], tmp_path)
    page = (tmp_path / "unsafe_sets.md").read_text()
    assert "heron meets heron, 2.5 m" in page
    assert "straight_horizon_s=5" in page
    assert f"| {content['pairs'][0]['shield_m2']:.1f} | {content['pairs'][0]['reach_m2']:.1f} |" in page
    assert all(f"| {bar['name']} |" in page for bar in content["goals"])


def meeting(*places):
    """States of two herons head on at full speed, the opponent at each place, m."""
    platform = get_platform("heron")
    own, other = full_thrust_state(platform, 2.0), full_thrust_state(platform, 2.0, 180.0)
    state = np.tile(np.stack([own, other]), (len(places), 1, 1))
    state[:, 1, : L.Y + 1] = places
    return state


def test_boats_head_on_are_saved_until_the_table_says_that_nobody_can(heron):
    state = meeting((0.0, 3.0), (0.0, 4.0), (0.0, 12.0))
    assert (values_m(heron, state) < RADIUS_M).tolist() == [True, True, False]
    assert games_lost(heron, ShieldConfig(), state, RADIUS_M, 8.0).tolist() == [True, True, False]


def test_the_area_of_the_reachability_set_is_the_tables_own(heron, few, monkeypatch):
    """Where neither the table itself nor the shield loses a game."""
    for name in ("duels_lost", "games_lost"):
        place = 1 if name == "duels_lost" else 2
        monkeypatch.setattr(sets, name, lambda *given, place=place: np.zeros(len(given[place]), bool))
    monkeypatch.setattr(sets, "PLAYED_RANGES", 200)
    monkeypatch.setattr(sets, "PLAYED_BEARINGS", 72)
    job = {"own": "heron", "other": "heron", "radius_m": RADIUS_M, "shield": {}, "place": HEAD_ON}
    one = PlayedSet(**play_job(job)[0])
    assert one.reach_m2 == pytest.approx(area_m2(heron, RADIUS_M, *HEAD_ON), rel=0.02)
    assert (one.lost_m2, one.ratio) == (0.0, 1.0)


def test_the_command_goes_on_where_it_was_cut_off_and_makes_a_page(tmp_path, few):
    folder, file = tmp_path / "run", tmp_path / "sets.json"
    words = ("reach", "play", *BOATS, "--jobs", "1", "--out", folder)
    first = run(*words, "--json", file)
    assert first.exit_code == 0, first.output
    content = json.loads(file.read_text())
    assert content == json.loads((folder / "results.json").read_text())
    assert undocumented(content, KEYS["reach play"]) == []
    assert content["sets"][0]["played"] > 10
    again = run(*words, "--resume", "--json", file)
    assert again.exit_code == 0
    assert json.loads(file.read_text())["sets"] == content["sets"]
    assert len((folder / "rows.jsonl").read_text().splitlines()) == 1
    write_pages([content], tmp_path)
    page = (tmp_path / "played_sets.md").read_text()
    assert "heron meets heron, 2.5 m" in page
    assert f"| {content['sets'][0]['reach_m2']:.1f} | {content['sets'][0]['lost_m2']:.1f} |" in page
