import json
from pathlib import Path

import json_keys as keys
import numpy as np
import pytest
from commands import run
from rich.console import Console
from steerclear.env.record import read_meta, validate
from steerclear.experiments.console import ExitCode
from steerclear.experiments.encounters import Conditions, draw, play, results
from steerclear.experiments.encounters.replay import record_of
from steerclear.experiments.encounters.report import cells_table
from steerclear.experiments.encounters.results import Cell, goals_of, worst_encounters
from steerclear.experiments.encounters.scenarios import FAMILIES

pytestmark = pytest.mark.usefixtures("elsewhere")

USUAL = Conditions()
SMALL = ["encounters", "--platform", "heron", "--family", "head_on,doorway", "--n", "3", "--workers", "1"]


def test_a_small_run_from_end_to_end_and_again():
    done = run(*SMALL, "--guard", "none", "--out", "out", "--json", "copy.json")
    assert done.exit_code == ExitCode.OK, done.output
    content = json.loads(Path("copy.json").read_text())
    assert keys.undocumented(content, keys.KEYS["encounters"]) == []
    assert (content["complete"], content["encounters_played"], content["encounters_resumed"]) == (True, 6, 0)
    assert [cell["family"] for cell in content["cells"]] == ["head_on", "doorway"]
    assert content["goals"] == []
    assert "head_on" in Path("out/report.html").read_text()
    assert Path("out/replay.html").stat().st_size > 0
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    resumed = run(*SMALL, "--guard", "none", "--out", "out", "--resume", "--json", "copy.json")
    assert resumed.exit_code == ExitCode.OK
    second = json.loads(Path("copy.json").read_text())
    assert second["encounters_resumed"] == 6
    assert second["cells"] == content["cells"]
    assert run(*SMALL, "--guard", "none", "--no-judge", "--out", "quick").exit_code == ExitCode.OK
    assert " not judged)" in Path("quick/report.html").read_text()


def test_the_same_scenes_for_every_guard_and_exit_status_one_for_avoidable_violations(monkeypatch):
    monkeypatch.setattr(results, "measure_chunk", _violating(results.measure_chunk))
    done = run(*SMALL, "--guard", "none,shield", "--no-judge", "--out", "out")
    assert done.exit_code == ExitCode.GOAL_MISSED, done.output
    cells = json.loads(Path("out/results.json").read_text())["cells"]
    bare = {(cell["filter"], cell["family"]): cell["unshielded_violated"] for cell in cells}
    assert bare["none", "head_on"] == bare["shield", "head_on"]


def _violating(measure_chunk):
    def measured(scenes, safety_filter, conditions, judge):
        columns = measure_chunk(scenes, safety_filter, conditions, judge)
        columns["avoidable"] = np.ones_like(columns["avoidable"])
        return columns

    return measured


@pytest.mark.parametrize("family", ["rammer_2", "corner"])
def test_a_game_of_a_film_is_a_record_within_its_bounds(family):
    film = play(draw(family, "heron", "heron", USUAL, 0, 0, 2), "none", USUAL)
    record = record_of(film, 1, "a name", is_filtered=True)
    validate(record)
    meta = read_meta(record)
    assert meta["shielded"] == ["agent_0"]
    if family == "rammer_2":
        assert (record["position"] > 0.0).all()
        assert (record["position"] < np.array(meta["env_bounds_m"])).all()
    shift = record["position"] - film.state[:, 1, :, :2]
    np.testing.assert_allclose(shift, np.broadcast_to(shift[0, 0], shift.shape), atol=1e-9)
    assert (record["violations"][:, 1] == 0).all()


@pytest.mark.parametrize(
    ("avoidable", "unavoidable", "not_judged", "expected"),
    [(0, 0, 0, [True, True]), (1, 0, 0, [False, True]), (0, 2, 0, [True, False]), (0, 0, 1, [None, None])],
)
def test_goals_of_the_shield(avoidable, unavoidable, not_judged, expected):
    counts = {"avoidable": avoidable, "unavoidable": unavoidable, "not_judged": not_judged, "encounters": 100}
    cell = Cell("shield:straight_horizon_s=4", "heron", "heron", "rammer_2")._asdict() | counts
    assert [goal["met"] for goal in goals_of([cell])] == expected
    assert goals_of([cell | {"filter": "parabolic"}]) == []


def test_the_table_of_a_thousand_encounters_cuts_nothing_off_at_80_columns():
    counts = {"unshielded_violated": 1000, "started_outside": 1000, "never_arrived_percent": 41.7, "decision_us": 28.3}
    names = ("violated", "avoidable", "not_judged", "unavoidable", "started_inside", "violations_outside", "deadlocked")
    means = dict.fromkeys(("closest_m", "goal_time_ratio"), 2.6) | {"avoidable_upper": 0.003}
    means |= dict.fromkeys(("changed_percent", "reversals_per_min"), 10.6)
    cell = Cell("shield", "heron", "heron", "crossing_right")._asdict() | dict.fromkeys(names, 0)
    console = Console(width=80)
    with console.capture() as shown:
        console.print(*cells_table({"cells": [cell | counts | means | {"encounters": 1000}]}))
    text = shown.get()
    assert "…" not in text
    heads, row = (text.splitlines()[k].split() for k in (1, 3))
    assert (row[0], row[heads.index("out%") + 1], row[heads.index("lost") + 1]) == ("crossing_right", "0.00", "41.7")


@pytest.mark.parametrize("family", FAMILIES)
def test_no_column_of_a_family_goes_into_a_further_table_at_80_columns(family):
    """Of all encounters violated, none judged, by a filter that takes its time."""
    counts = ("unshielded_violated", "violated", "not_judged", "violations_outside", "started_outside", "encounters")
    means = dict.fromkeys(("closest_m", "goal_time_ratio", "changed_percent", "reversals_per_min"), 10.6)
    more = {"avoidable": 0, "unavoidable": 0, "started_inside": 0, "deadlocked": 0, "decision_us": 813.0}
    more |= {"avoidable_upper": 1.0, "never_arrived_percent": 41.7}
    cell = Cell("none", "heron", "heron", family)._asdict() | dict.fromkeys(counts, 1000) | means | more
    console = Console(width=80)
    with console.capture() as shown:
        console.print(*cells_table({"cells": [cell]}))
    text = shown.get()
    assert sum("─" in line for line in text.splitlines()) == 1, text
    assert " 1000? " in text
    assert "1,000 encounters each" in text


def test_the_worst_encounters_of_every_filter_are_shown():
    columns = {
        Cell(name, "heron", "heron", family): {
            **dict.fromkeys(("number", "variant", "violations_teammate", "violations_opponent"), np.arange(20.0)),
            **dict.fromkeys(("avoidable", "responsible", "last_preventable_s", "start_safety_margin_m"), np.zeros(20)),
            "closest_m": closest_m + np.arange(20.0),
        }
        for name, closest_m in (("none", 0.0), ("shield", 2.6), ("gatekeeper", 1.0))
        for family in ("rammer_1", "head_on")
    }
    worst = worst_encounters(columns)
    assert [one["filter"] for one in worst] == ["shield"] * 5 + ["gatekeeper"] * 5
    assert [one["closest_m"] for one in worst[:3]] == [2.6, 2.6, 3.6]
    bare = {cell: values for cell, values in columns.items() if cell.filter == "none"}
    assert {one["filter"] for one in worst_encounters(bare)} == {"none"}
