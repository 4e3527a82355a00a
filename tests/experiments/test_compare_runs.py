"""Two results beside one another: only pairs count, what differs is told, and what are no pairs is refused."""

import json
import math

import pytest
from commands import run
from json_keys import KEYS, undocumented
from steerclear.experiments.compare_runs import compare_runs, read_run
from steerclear.experiments.console import ExitCode
from steerclear.experiments.result_files import write_json
from steerclear.experiments.runner import append_row
from steerclear.shield.exceptions import ConfigError

SETTINGS = {
    "preset": "aamas2024",
    "own": "medium",
    "opponents": ["easy", "hidden"],
    "games": 3,
    "seed": 5,
    "sides": ["blue", "red"],
    "shield": {},
    "states": [False, True],
    "shield_autopilot": True,
    "rules": {},
    "fixed_start": False,
    "penalty": 1.0,
    "judge": "none",
    "conditions": {"delay_s": 0.0},
    "trust": False,
    "answer_s": 10.0,
}


def row(opponent, game, shielded, **figures):
    return {
        "own": "medium",
        "opponent": opponent,
        "shielded": shielded,
        "seed": 5 + game,
        "side": ("blue", "red")[game % 2],
        "own_files": "",
        "opponent_files": "",
        "captures": 0,
        "captures_against": 0,
        "net_captures": figures.get("captures", 0),
        "changed_steps": 0,
        "covered_steps": 100 if shielded else 0,
        "violations_opponent_2.5m": 0,
        "violations_teammate_2.5m": 0,
        **figures,
    }


def write_run(folder, rows, **settings):
    folder.mkdir()
    for number, one in enumerate(rows):
        append_row(folder / "rows.jsonl", f"{number}", [one])
    told = {**SETTINGS, **settings}
    content = {"command": "ablate", "settings": told, "seeds": [5, 6, 7], "versions": {"steerclear": "1"}}
    write_json(folder / "results.json", content)
    return folder


@pytest.fixture
def folders(tmp_path):
    """In the first one capture a game and 10 % changed, in the second 0, 1, 2 more and 20 %; a game is missing."""
    first = [row("easy", g, True, captures=1, changed_steps=10) for g in range(3)]
    second = [row("easy", g, True, captures=1 + g, changed_steps=20) for g in (2, 0, 1)]
    others = [row("easy", 0, False, captures=9), row("hidden", 1, True, captures=9)]
    a = write_run(tmp_path / "a", [*first, *others], shield={"separation_m": 2.5})
    b = write_run(tmp_path / "b", second, shield={"separation_m": 4.0, "profile": "ramming"})
    return a, b


def test_games_of_one_seed_are_pairs_and_only_those_count(folders):
    found = compare_runs(*map(read_run, folders))
    assert [(one["opponent"], one["pairs"]) for one in found["pairings"]] == [("easy", 3)]
    metrics = found["pairings"][0]["metrics"]
    captures, changed = metrics["captures"], metrics["changed_share"]
    assert (captures["first"]["value"], captures["second"]["value"], captures["difference"]["value"]) == (1.0, 2.0, 1.0)
    assert 0.0 <= captures["difference"]["low"] < 1.0 < captures["difference"]["high"] <= 2.0
    assert (changed["first"]["value"], changed["second"]["value"]) == (10.0, 20.0)
    assert changed["difference"]["value"] == pytest.approx(10.0)
    assert "tags" not in metrics, "no game has that column"
    assert found["differs"] == {"shield.separation_m": [2.5, 4.0], "shield.profile": [None, "ramming"]}


def test_hits_of_an_earlier_version_are_compared_under_their_earlier_names(folders, tmp_path):
    rows = [row("easy", game, True) for game in range(3)]
    rows = [{name.replace("violations", "breaches"): value for name, value in one.items()} for one in rows]
    earlier = write_run(tmp_path / "c", [one | {"breaches_opponent_2.5m": 2} for one in rows])
    metrics = compare_runs(read_run(earlier), read_run(folders[1]))["pairings"][0]["metrics"]
    assert metrics["violations_opponent_2.5m"]["difference"]["value"] == -2.0


def test_games_without_a_shield_are_compared_where_there_are_no_others(folders, tmp_path):
    bare = write_run(tmp_path / "c", [row("easy", 0, False, captures=4)], states=[False])
    found = compare_runs(read_run(bare), read_run(folders[1]))
    assert found["differs"]["shielded"] == [False, True]
    assert found["pairings"][0]["pairs"] == 1
    assert found["pairings"][0]["metrics"]["captures"]["difference"]["value"] == -3.0
    assert math.isnan(found["pairings"][0]["metrics"]["changed_share"]["first"]["value"])


@pytest.mark.parametrize(
    ("name", "value"),
    [("preset", "mctf2025"), ("rules", {"max_time_s": 60.0}), ("fixed_start", True), ("penalty", 0.5)],
)
def test_games_of_other_rules_are_no_pairs(name, value, folders, tmp_path):
    other = write_run(tmp_path / "c", [row("easy", 0, True)], **{name: value})
    with pytest.raises(ConfigError, match=f"have another {name} .* play both alike but for what you compare"):
        compare_runs(read_run(folders[0]), read_run(other))


def test_games_of_other_seeds_sides_or_files_are_no_pairs(folders, tmp_path):
    other = write_run(tmp_path / "c", [row("easy", 0, True, side="red"), row("easy", 1, True, seed=7)])
    with pytest.raises(ConfigError, match="no game of the same opponent, seed and side"):
        compare_runs(read_run(folders[0]), read_run(other))
    changed = write_run(tmp_path / "d", [row("easy", 0, True, opponent_files="x")])
    with pytest.raises(ConfigError, match="files of easy changed between both runs"):
        compare_runs(read_run(folders[0]), read_run(changed))
    mixed = write_run(tmp_path / "e", [row("easy", 0, True), row("easy", 0, True, captures=3)])
    with pytest.raises(ConfigError, match="holds games of several settings"):
        read_run(mixed)


def test_what_is_no_results_folder_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="is no folder; give a results folder"):
        read_run(tmp_path / "none")
    for content, words in (({"command": "bench"}, "results of 'bench', not of games"), ([], "results of None")):
        (tmp_path / "results.json").write_text(json.dumps(content))
        with pytest.raises(ConfigError, match=words):
            read_run(tmp_path)
    (tmp_path / "results.json").write_text('{"command": "ablate", "settings": {}}')
    with pytest.raises(ConfigError, match="of another version"):
        read_run(tmp_path)
    (tmp_path / "games.jsonl").touch()
    with pytest.raises(ConfigError, match=r"of steerclear 0\.8\.0 or earlier, whose games this version does not read"):
        read_run(tmp_path)


def test_the_command_shows_the_table_and_writes_what_is_documented(folders, tmp_path):
    file = tmp_path / "c.json"
    done = run("compare", *folders, "--json", file)
    assert done.exit_code == ExitCode.OK, done.output
    assert "differs: shield.profile: default in A, ramming in B" in done.stdout
    assert "against easy: 3 pairs" in done.stdout
    assert "1.00 [0.00, 2.0]" in done.stdout
    assert "fewer than 20 pairs say little" in done.stdout
    assert undocumented(json.loads(file.read_text()), KEYS["compare"]) == []
