"""The shield's unavoidable set beside that of reachability, two methods that share nothing but the boats."""

import json
import math

import pytest
from json_keys import KEYS, undocumented
from steerclear.experiments import cli
from steerclear.experiments.docs import write_pages
from steerclear.experiments.reach import sets
from steerclear.experiments.reach.pages import sets_goals
from steerclear.experiments.reach.sets import (
    MISSED_PERCENT_GOAL,
    RATIO_GOAL,
    SetPair,
    compare_pair,
)
from steerclear.shield import ShieldConfig
from steerclear.shield.tables.areas import area_m2
from steerclear.shield.tables.files import load_table
from typer.testing import CliRunner

RADIUS_M = 2.5
BARE = ShieldConfig(separation_m=RADIUS_M, buffer_m=0.0)
BOATS = ["--own", "heron", "--other", "heron"]


@pytest.fixture(scope="module")
def heron():
    return load_table("heron", "heron")


@pytest.fixture
def head_on(monkeypatch):
    """Compares one pair of speeds and one heading only."""
    monkeypatch.setattr(sets, "HEADINGS_DEG", (180.0,))
    monkeypatch.setattr(sets, "SPEED_SHARES", ((1.0, 1.0),))


def compare(*arguments):
    return CliRunner().invoke(cli.app, ["reach", "compare", *BOATS, *arguments])


def head(**settings):
    return {"settings": {"own": "heron", "other": "heron", "radius_m": RADIUS_M, "shield": settings}}


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


def test_a_shield_that_looks_up_the_table_is_not_judged_by_what_it_misses(tmp_path, head_on):
    file = tmp_path / "sets.json"
    settings = ["--shield-set", "opponent_model=value_table", "--shield-set", "table_margin_m=0"]
    assert compare("--json", str(file), *settings).exit_code == 0
    content = json.loads(file.read_text())
    assert content["looked_up"]
    assert {bar["met"] for bar in content["goals"] if "misses" in bar["name"]} == {None}
    write_pages([content], tmp_path)
    assert "looks opponents up in this very table" in (tmp_path / "unsafe_sets.md").read_text()
    file.unlink()
    run_through = compare("--json", str(file), "--shield-set", "opponent_model=turning_circle")
    assert run_through.exit_code == 0
    assert not json.loads(file.read_text())["looked_up"]
    write_pages([json.loads(file.read_text())], tmp_path)
    assert "this very table" not in (tmp_path / "unsafe_sets.md").read_text()


def test_bars_judge_the_worst_pair():
    fine, large, missing = (SetPair(2.0, 2.0, 0.0, *areas) for areas in ((30, 30, 0.1), (60, 30, 0), (30, 30, 3)))
    assert [bar["met"] for bar in sets_goals([fine])] == [True, True]
    assert [bar["met"] for bar in sets_goals([fine, large])] == [False, True]
    assert [bar["met"] for bar in sets_goals([missing, fine])] == [True, False]
    assert [bar["limit"] for bar in sets_goals([fine])] == [RATIO_GOAL, MISSED_PERCENT_GOAL]
    assert [bar["value"] for bar in sets_goals([large, missing])] == pytest.approx([2.0, 10.0])


def test_the_command_writes_documented_json_that_becomes_a_page(tmp_path, head_on):
    file = tmp_path / "sets.json"
    result = compare("--json", str(file), "--shield-set", "straight_horizon_s=5")
    assert result.exit_code == 0, result.output
    content = json.loads(file.read_text())
    assert undocumented(content, KEYS["reach compare"]) == []
    assert content["settings"] == head(straight_horizon_s=5)["settings"]
    assert content["versions"]["steerclear"]
    assert content["machine"]["cores"] >= 1
    assert content["wall_s"] > 0
    write_pages([content], tmp_path)
    page = (tmp_path / "unsafe_sets.md").read_text()
    assert "cannot promise to save" in page.splitlines()[0]
    assert "heron meets heron, 2.5 m" in page
    assert "straight_horizon_s=5" in page
    assert f"| {content['pairs'][0]['shield_m2']:.1f} | {content['pairs'][0]['reach_m2']:.1f} |" in page
    for bar in content["goals"]:
        assert f"| {bar['name']} |" in page
