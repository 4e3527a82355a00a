"""The set from which the shield does not save a boat: what counts as lost, and that it is seen."""

import json

import numpy as np
import pytest
from json_keys import KEYS, undocumented
from steerclear.experiments import cli
from steerclear.experiments.docs import write_pages
from steerclear.experiments.reach import sets
from steerclear.experiments.reach.pages import PLAYED_COLUMNS, played_goals, rows_of
from steerclear.experiments.reach.sets import RATIO_GOAL, PlayedSet, games_lost, play_job, values_m
from steerclear.shield import ShieldConfig
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tables.areas import area_m2
from steerclear.shield.tables.files import load_table
from steerclear.shield.tables.margin import full_thrust_state
from typer.testing import CliRunner

RADIUS_M = 2.5
HEAD_ON = (180.0, 2.0, 2.0)
BOATS = ["--own", "heron", "--other", "heron"]


@pytest.fixture(scope="module")
def heron():
    return load_table("heron", "heron")


@pytest.fixture
def few(monkeypatch):
    """One pair of speeds, one heading, few positions and short games, all in this process."""
    monkeypatch.setattr(sets, "HEADINGS_DEG", (180.0,))
    monkeypatch.setattr(sets, "SPEED_SHARES", ((1.0, 1.0),))
    monkeypatch.setattr(sets, "PLAYED_RANGES", 40)
    monkeypatch.setattr(sets, "PLAYED_BEARINGS", 12)
    monkeypatch.setattr(sets, "LONGEST_S", 6.0)


def meeting(*places):
    """States of two herons head on at full speed, the opponent at each place, m."""
    platform = get_platform("heron")
    own, other = full_thrust_state(platform, 2.0), full_thrust_state(platform, 2.0, 180.0)
    state = np.tile(np.stack([own, other]), (len(places), 1, 1))
    state[:, 1, : L.Y + 1] = places
    return state


def play_head_on():
    job = {"own": "heron", "other": "heron", "radius_m": RADIUS_M, "shield": {}, "place": HEAD_ON}
    return PlayedSet(**play_job(job)[0])


def play(*arguments):
    jobs = [] if "--jobs" in arguments else ["--jobs", "1"]
    return CliRunner().invoke(cli.app, ["reach", "play", *BOATS, *jobs, *arguments])


def test_boats_head_on_are_saved_until_the_table_says_that_nobody_can(heron):
    state = meeting((0.0, 3.0), (0.0, 4.0), (0.0, 12.0))
    assert (values_m(heron, state) < RADIUS_M).tolist() == [True, True, False]
    assert games_lost(heron, ShieldConfig(), state, RADIUS_M, 8.0).tolist() == [True, True, False]


@pytest.fixture
def no_duels(monkeypatch):
    """Nothing lost by the table itself, at once."""
    monkeypatch.setattr(sets, "duels_lost", lambda values, start, *_: np.zeros(len(start), bool))


def test_the_area_of_the_reachability_set_is_the_tables_own(heron, few, no_duels, monkeypatch):
    monkeypatch.setattr(sets, "PLAYED_RANGES", 200)
    monkeypatch.setattr(sets, "PLAYED_BEARINGS", 72)
    monkeypatch.setattr(sets, "games_lost", lambda values, config, start, *_: np.zeros(len(start), bool))
    one = play_head_on()
    assert one.reach_m2 == pytest.approx(area_m2(heron, RADIUS_M, *HEAD_ON), rel=0.02)
    assert (one.lost_m2, one.ratio) == (0.0, 1.0)


def test_the_command_goes_on_where_it_was_cut_off_and_makes_a_page(tmp_path, few):
    folder, file = tmp_path / "run", tmp_path / "sets.json"
    first = play("--out", str(folder), "--json", str(file))
    assert first.exit_code == 0, first.output
    content = json.loads(file.read_text())
    assert content == json.loads((folder / "results.json").read_text())
    assert undocumented(content, KEYS["reach play"]) == []
    assert content["sets"][0]["played"] > 10
    refused = play("--out", str(folder))
    assert refused.exit_code == 2
    assert "--resume" in refused.output
    again = play("--out", str(folder), "--resume", "--json", str(file))
    assert json.loads(file.read_text())["sets"] == content["sets"]
    assert again.exit_code == 0
    assert len((folder / "rows.jsonl").read_text().splitlines()) == 1
    write_pages([content], tmp_path)
    page = (tmp_path / "played_sets.md").read_text()
    assert "heron meets heron, 2.5 m" in page
    assert f"| {content['sets'][0]['reach_m2']:.1f} | {content['sets'][0]['lost_m2']:.1f} |" in page


def test_the_worst_row_is_judged():
    fine, large, beyond = (
        PlayedSet(2.0, 2.0, 0.0, 30.0, lost_m2, 3.0, 100, 50, lost) for lost_m2, lost in ((1.0, 0), (6.0, 0), (1.0, 1))
    )
    assert [bar["met"] for bar in played_goals([fine])] == [True, True]
    assert [(bar["met"], bar["limit"]) for bar in played_goals([fine, large])] == [(False, RATIO_GOAL), (True, 0.0)]
    assert [bar["met"] for bar in played_goals([fine, beyond])] == [True, False]
    row = dict(zip(PLAYED_COLUMNS, rows_of([large], PLAYED_COLUMNS)[0], strict=True))
    assert (row["ratio"], row["by table"], row["lost beyond"]) == ("1.20", "1.10", "0 of 50")
