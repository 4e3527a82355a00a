"""A command that is safe is sent bit for bit, in the frame it was given in."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from shield_scenes import bits, distances, finite_commands, fleet_of, fleets, head_on, quick, relative
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig

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


@quick
@given(st.data())
def test_boats_not_controlled_get_what_they_were_given(data):
    fleet = data.draw(fleets())
    values = np.array(data.draw(finite_commands(len(fleet))), dtype=float).reshape(-1, 2)
    values[~fleet.controlled] = [np.nan, np.inf]
    decisions = Shield().decide(fleet, Commands.relative_deg(values))
    others = ~fleet.controlled
    assert bits(decisions.filtered.values[others]) == bits(values[others])
    assert (decisions.reason[others] == Reason.NOT_COVERED).all()
    assert np.isinf(decisions.safety_margin_m[others]).all()


def test_only_the_boat_in_danger_is_changed():
    """A head-on far from a third boat of ours, whose odd command must pass while the first one's is changed."""
    fleet = fleet_of([(0, 0, 0, 2.0), (0, 5.2, 180, 2.0), (300, 0, 0, 1.0)], [0, 1, 0])
    wanted = relative((2.0, 0.0), (2.0, 0.0), (-0.0, 5e-324))
    decisions = Shield(adversary_horizon_s=0.0).decide(fleet, wanted)
    assert decisions.intervened.tolist() == [True, False, False]
    assert bits(decisions.filtered.values[1:]) == bits(wanted.values[1:])
    assert np.isfinite(decisions.filtered.values).all()


@pytest.mark.parametrize("coordination", ["team", "per_boat"])
def test_a_change_is_made_in_the_frame_of_the_wanted_command(coordination):
    fleet = head_on(5.2)
    shield = Shield(adversary_horizon_s=0.0, coordination=coordination)
    turned = shield.decide(fleet, relative((2.0, 0.0), (2.0, 0.0)))
    shield.reset()
    absolute = shield.decide(fleet, Commands.absolute_rad([[2.0, 0.0], [2.0, np.pi]]))
    assert turned.intervened[0]
    assert absolute.intervened[0]
    for field in ("filtered_speed_mps", "filtered_heading_rad", "safety_margin_m"):
        assert getattr(turned[0], field) == pytest.approx(getattr(absolute[0], field), abs=1e-9)


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
