"""Contracts of one decision: what is safe passes bit for bit, what is not usable never comes out, all is told."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from shield_scenes import bits, distances, finite_commands, fleet_of, fleets, head_on, quick, relative
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms.usv import fresh_state

AHEAD = relative((2, 0), (2, 0))

KEPT_M = 2.5


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


def test_decisions_print_as_a_table():
    lines = str(Shield().decide(head_on(9.0), AHEAD)).splitlines()
    heads = ("boat", "nominal", "deg", "m/s", "filtered", "deg", "m/s", "reason", "active", "constraint", "margin", "m")
    assert lines[0].split() == [*heads]
    assert lines[1].startswith("boat_0 ")
    assert "NOT_COVERED" in lines[2]
    assert {len(line) <= 120 for line in lines} == {True}
    assert len(lines) == 3


ODD = [0.0, -0.0, 5e-324, -5e-324, 1e-310, 1.0 + 2**-52, 179.99999999999997, -180.0, 180.0, 359.0]


def far_apart():
    return fleet_of([(0, 0, 10.0, 1.0), (500, 0, -170.0, 2.0), (0, 500, 90.0, 0.0)], [0, 0, 1])


@pytest.mark.parametrize("speed", [*ODD[:6], 2.0, 1e3])
@pytest.mark.parametrize("heading", ODD)
def test_odd_numbers_pass_bit_for_bit(speed, heading):
    to_boats = (Commands.relative_deg, Commands.absolute_rad) if speed <= 2.0 else ()  # of whom more is not asked
    for make in (Commands.game_deg, *to_boats):
        wanted = make([[speed, heading], [1.0, 0.3], [speed, heading]])
        decisions = Shield().decide(far_apart(), wanted)
        assert bits(decisions.filtered.values) == bits(wanted.values)
        assert decisions.filtered.relative == wanted.relative
        assert not decisions.intervened.any()
        assert decisions.reason.tolist() == [Reason.PASSED, Reason.PASSED, Reason.NOT_COVERED]


@quick
@given(st.data())
def test_what_is_marked_passed_is_what_was_wanted_bit_for_bit(data):
    fleet = data.draw(fleets())
    values = data.draw(finite_commands(len(fleet)))
    wanted = data.draw(st.sampled_from([Commands.relative_deg, Commands.absolute_rad]))(values)
    before = bits(wanted.values)
    decisions = Shield().decide(fleet, wanted)
    same = np.isin(decisions.reason, [Reason.PASSED, Reason.NOT_COVERED])
    assert bits(wanted.values) == before, "the nominal commands were written to"
    assert bits(decisions.filtered.values[same]) == bits(wanted.values[same])
    assert not decisions.intervened[same].any()
    unchanged = ~decisions.intervened
    assert bits(decisions.filtered.values[unchanged]) == bits(wanted.values[unchanged])


@quick
@given(st.data())
def test_a_boat_that_passes_is_certified(data):
    """PASSED says that a backup is left: among boats alone, no boat that is not too near has a negative margin."""
    fleet = data.draw(fleets(most=4))
    decisions = Shield().decide(fleet, Commands.relative_deg(data.draw(finite_commands(len(fleet)))))
    apart = distances(fleet.position_m).min(axis=1) >= ShieldConfig().separation_m  # who just leaves another's radius
    passed = (decisions.reason == Reason.PASSED) & apart  # passes, too, and is told how far inside it is yet
    assume(passed.any())
    assert (decisions.safety_margin_m[passed] >= 0.0).all()


def test_a_boat_that_passed_takes_part_where_the_best_of_another_would_hit_it():
    """A large boat that can stop for nobody comes over one that lies still and wants to: it gets out of the way."""
    fleet = Fleet.of(
        position_m=[[0, 1], [0, 0], [0, 14], [0, 0]],
        heading_rad=np.radians([-27.0, 0.0, 0.0, -11.0]),
        speed_mps=[12, 0, 0, 12],
        team=[0, 0, 0, 0],
        platforms=["large_usv", "heron", "heron", "large_usv"],
        controlled=[False, False, True, True],
    )
    decisions = Shield().decide(fleet, Commands.relative_deg(np.zeros((4, 2))))
    assert decisions[3].reason is Reason.BEST_EFFORT
    assert decisions[2].reason in (Reason.BACKUP, Reason.LEAST_CHANGE)
    assert decisions[2].safety_margin_m >= 0.0


@pytest.mark.parametrize(("gap_m", "speed_mps"), [(9.0, 2.0), (20.0, 8.0), (30.0, 20.0), (9.0, 49.0)])
@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_an_opponent_that_comes_astern_is_one_that_comes(platform, gap_m, speed_mps):
    ahead, astern = (
        Shield().decide(
            fleet_of([(0, 0, 0, 1.5), (0.3, gap_m, heading, speed)], [0, 1], platform), relative((1.5, 0.0), (1.0, 9.0))
        )
        for heading, speed in ((180.0, speed_mps), (0.0, -speed_mps))
    )
    assert ahead[0].reason == astern[0].reason
    assert ahead[0].safety_margin_m < 0.2
    np.testing.assert_allclose(ahead.filtered.values, astern.filtered.values, atol=1e-9)
    assert ahead[0].safety_margin_m == pytest.approx(astern[0].safety_margin_m, abs=1e-9)
