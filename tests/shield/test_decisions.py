"""Contracts of one decision: what is safe passes bit for bit, what is not usable never comes out, all is told."""

from dataclasses import replace

import numpy as np
import pytest
from shield_scenes import fleet_of, head_on, relative
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import FleetError
from steerclear.shield.platforms.usv import fresh_state

AHEAD = relative((2, 0), (2, 0))
KEPT_M = 2.5


def test_the_same_inputs_give_the_same_bits():
    runs = []
    for _ in range(2):
        shield = Shield()
        runs.append([shield.decide(head_on(gap), AHEAD).filtered.values.tobytes() for gap in (6, 5.5, 5)])
    assert runs[0] == runs[1]


def test_mirrored_water_gives_the_mirrored_command():
    left = Shield().decide(fleet_of([(0, 0, 0, 2), (0.7, 5.1, 180, 2)], [0, 1]), relative((2, 5), (2, 0)))
    right = Shield().decide(fleet_of([(0, 0, 0, 2), (-0.7, 5.1, 180, 2)], [0, 1]), relative((2, -5), (2, 0)))
    assert left.intervened[0]
    np.testing.assert_allclose(left.filtered.values[0] * [1, -1], right.filtered.values[0], atol=1e-9)


@pytest.mark.parametrize("gap_m", [0.0, 0.1, 0.5, 1.0, 2.0, 2.4])
@pytest.mark.parametrize("coordination", ["team", "per_boat"])
@pytest.mark.parametrize("team", [(0, 1), (0, 0)])
def test_the_margin_in_breach_is_how_far_inside_the_boats_are(gap_m, coordination, team):
    decision = Shield(coordination=coordination).decide(fleet_of([(0, 0, 0, 2), (0, gap_m, 180, 2)], team), AHEAD)[0]
    assert decision.safety_margin_m == pytest.approx(gap_m - KEPT_M)
    assert decision.slack_m == pytest.approx(KEPT_M - gap_m)
    state = np.array([[fresh_state(0.0, 0.0, 0.0, 2.0), fresh_state(0.0, gap_m, 180.0, 2.0)]])
    batch = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), team)
    batch.decide(state, AHEAD.values[None], np.array([[True, False]]))
    assert batch.safety_margin_m[0, 0] == pytest.approx(gap_m - KEPT_M)


def test_in_breach_the_boats_part():
    decision = Shield().decide(fleet_of([(0.0, 0.0, 0.0, 1.5), (1.5, 0.5, 180.0, 1.5)], [0, 0]), AHEAD)
    assert set(decision.reason) == {Reason.BEST_EFFORT}


@pytest.mark.parametrize("wanted", [[[2.0, 0.0]] * 2, np.zeros((2, 2)), None])
def test_commands_of_another_kind_are_refused_with_the_remedy(wanted):
    with pytest.raises(FleetError, match=r"decide takes a Fleet and Commands, not Fleet and .*Commands\.absolute_rad"):
        Shield().decide(head_on(), wanted)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_one_command_per_boat_is_wanted(n):
    with pytest.raises(FleetError, match=r"commands of shape .* for 2 boats; give one row per boat"):
        Shield().decide(head_on(), relative(*[(2.0, 0.0)] * n))


def test_a_decision_says_everything():
    decision = Shield().decide(head_on(5.5), AHEAD)[0]
    assert decision.reason in (Reason.LEAST_CHANGE, Reason.BACKUP)
    assert decision.active_constraints == ("boat_1",)
    assert decision.safety_margin_m >= 0
    assert decision.solver == (None if decision.reason is Reason.BACKUP else "line_search")
    assert decision.filtered_heading_rad != decision.nominal_heading_rad


def test_decisions_that_say_the_same_are_equal_however_long_they_took():
    one, other = (Shield().decide(head_on(5.5), AHEAD)[0] for _ in range(2))
    slow, nobody = replace(other, solve_time_s=9.0), replace(one, nominal_heading_rad=float("nan"))
    assert one == slow
    assert hash(one) == hash(slow)
    assert one != replace(other, slack_m=0.5)
    assert one != "decision"
    assert nobody == replace(one, nominal_heading_rad=float("inf") - float("inf"))
    assert nobody != one


def test_decisions_are_indexed_by_place_and_name():
    decisions = Shield().decide(replace(head_on(), names=("ours", "theirs")), AHEAD)
    assert [one.boat for one in decisions] == ["ours", "theirs"]
    assert decisions["ours"] == decisions[0] == decisions[-2]
    assert decisions["theirs"] == decisions[1] == decisions[np.str_("theirs")] == decisions[np.int64(-1)]
    assert "ours" in decisions
    assert "boat_0" not in decisions
    assert decisions[1] in decisions
    for place in (2, -3):
        with pytest.raises(IndexError, match="no boat"):
            decisions[place]


@pytest.mark.parametrize(
    ("index", "text"),
    [
        ("boat_2", "no boat 'boat_2' in the fleet decided on; did you mean 'boat_1'?"),
        ("zzz", "no boat 'zzz' in the fleet decided on; there are boat_0, boat_1"),
        (1.0, "indexed by a boat's name or place in the fleet, not by 1.0"),
        (True, "not by True"),
        (np.False_, "not by np.False_"),
        (None, "not by None"),
        ([0, 1], r"not by \[0, 1\]; of several boats at once see their arrays: filtered.values"),
        (np.array([True, False]), "of several boats at once"),
        (slice(0, 1), "of several boats at once"),
        (b"boat_0", "not by b'boat_0'"),
    ],
)
def test_what_is_no_boat_of_the_decisions_is_told_how_to_ask(index, text):
    with pytest.raises(FleetError, match=text):
        Shield().decide(head_on(), AHEAD)[index]


def test_decisions_print_as_a_table():
    lines = str(Shield().decide(head_on(9.0), AHEAD)).splitlines()
    heads = ("boat", "nominal", "deg", "m/s", "filtered", "deg", "m/s", "reason", "active", "constraint", "margin", "m")
    assert lines[0].split() == [*heads]
    assert lines[1].startswith("boat_0 ")
    assert "NOT_COVERED" in lines[2]
    assert {len(line) <= 120 for line in lines} == {True}
    assert len(lines) == 3
