"""Contracts of one decision: what is safe passes bit for bit, what is not usable never comes out, all is told."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shield_scenes import any_commands, bits, distances, finite_commands, fleet_of, fleets, head_on, quick, relative
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.commands import ROUNDING_MPS
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
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
def test_the_margin_in_violation_is_how_far_inside_the_boats_are(gap_m, coordination, team):
    decision = Shield(coordination=coordination).decide(fleet_of([(0, 0, 0, 2), (0, gap_m, 180, 2)], team), AHEAD)[0]
    assert decision.safety_margin_m == pytest.approx(gap_m - KEPT_M)
    assert decision.slack_m == pytest.approx(KEPT_M - gap_m)
    state = np.array([[fresh_state(0.0, 0.0, 0.0, 2.0), fresh_state(0.0, gap_m, 180.0, 2.0)]])
    batch = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), team)
    batch.decide(state, AHEAD.values[None], np.array([[True, False]]))
    assert batch.safety_margin_m[0, 0] == pytest.approx(gap_m - KEPT_M)


def test_the_margin_of_a_boat_that_nobody_can_meet_is_infinite_everywhere():
    fleet = Fleet.of(
        position_m=[(0, 0), (900, 0)], heading_deg=[0, 0], speed_mps=[1, 1], team=[0, 1], platforms="heron"
    )
    decisions = Shield().decide(fleet, Commands.relative_deg([(1.0, 0.0)] * 2))
    batch = BatchedShield(ShieldConfig(), 1, ("heron",) * 2, (0, 1))
    batch.decide(np.nan_to_num(fleet.state[None]), np.array([[[1.0, 0.0]] * 2]), np.array([[True, False]]))
    assert np.isinf([decisions.safety_margin_m[0], decisions[0].safety_margin_m, batch.safety_margin_m[0, 0]]).all()


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


STRAIGHT = relative((3.0, 0.0), (3.0, 0.0))


def near(**more):
    """A surveyor of ours and an opponent coming at it, both at full thrust."""
    fleet = fleet_of([(0.0, 0.0, 0.0, 3.0), (1.0, 22.0, 180.0, 3.0)], [0, 1], "surveyor")
    state = fleet.state.copy()
    state[:, L.THRUST] = 100.0
    return replace(fleet, state=state, **more)


def safety_margin_m(fleet, **settings):
    return Shield(**settings).decide(fleet, STRAIGHT)[0].safety_margin_m


@pytest.mark.parametrize(
    ("settings", "always_s", "visiting_s"),
    [
        ({}, 12.0, 7.0),
        ({"profile": "ramming"}, np.inf, np.inf),
        ({"profile": "constant_velocity"}, 0.0, 0.0),
        ({"adversary_horizon_s": 9.0}, 9.0, 9.0),
        ({"intruder_horizon_s": 3.0}, 12.0, 3.0),
        ({"adversary_horizon_s": 20.0, "intruder_horizon_s": 0.0}, 20.0, 0.0),
    ],
)
def test_a_profile_says_both_and_one_dial_turns_both(settings, always_s, visiting_s):
    config = ShieldConfig(**settings)
    assert (config.effective_adversary_horizon_s, config.effective_intruder_horizon_s) == (always_s, visiting_s)


def test_a_visitor_is_feared_as_if_all_were_for_its_time_and_a_mate_is_not():
    visiting = near(visiting=np.array([False, True]))
    assert safety_margin_m(visiting) == safety_margin_m(near(), adversary_horizon_s=7.0)
    assert safety_margin_m(visiting) > safety_margin_m(near()) + 0.1, "else the scene shows nothing"
    assert safety_margin_m(near(visiting=np.array([True, False]))) == safety_margin_m(near()), "of our own"


def test_what_the_caller_says_of_a_boat_comes_first():
    fleet = near(visiting=np.array([False, True]), adversary_horizon_s=np.array([np.nan, 20.0]))
    assert safety_margin_m(fleet) == safety_margin_m(near(), adversary_horizon_s=20.0)
    unsaid = near(adversary_horizon_s=np.array([np.nan, np.nan]))
    assert safety_margin_m(unsaid) == safety_margin_m(near())


def test_a_decision_says_how_long_it_feared_whom():
    told = Shield().decide(near(visiting=np.array([False, True])), STRAIGHT)
    assert [decision.adversary_horizon_s for decision in told] == [None, 7.0]
    assert [d.adversary_horizon_s for d in Shield(profile="ramming").decide(near(), STRAIGHT)] == [None, np.inf]
    told = Shield(profile="constant_velocity").decide(near(adversary_horizon_s=np.array([np.nan, 20.0])), STRAIGHT)
    assert [d.adversary_horizon_s for d in told] == [None, 0.0], (
        "with this profile nobody is feared, whatever is said of one"
    )


BAD = [math.nan, math.inf, -math.inf, 1.7e308, -1.7e308, 1e7]

HARBOUR = Surroundings(
    field=(-15.0, -15.0, 15.0, 15.0),
    circles=[(4.0, 4.0, 1.0), (0.0, 0.0, 0.0)],
    polygons=[[(-6.0, 0.0), (-4.0, 0.0), (-5.0, 3.0)], [(1.0, 1.0), (1.0, 1.0), (1.0, 1.0)]],
    keep_out=[(0.0, -5.0, 2.0)],
)

FORMS = st.fixed_dictionaries(
    {
        "opponent_model": st.sampled_from(["turning_circle", "value_table"]),
        "coordination": st.sampled_from(["team", "per_boat"]),
        "adversary_horizon_s": st.sampled_from([0.0, 3.0, math.inf]),
        "cbf_rate_per_s": st.sampled_from([0.5, math.inf]),
        "separation_m": st.sampled_from([2.5, 4.0, 1e-3]),
    }
)


@settings(parent=quick, max_examples=80)
@given(st.data(), FORMS, st.booleans())
def test_whatever_goes_in_finite_commands_come_out(data, form, harbour):
    """Coincident boats, boats inside the radius, no speed, mixed platforms, nobody of ours: all of it, all settings."""
    fleet = data.draw(fleets())
    shield = Shield(surroundings=HARBOUR if harbour else Surroundings(), **form)
    make = data.draw(st.sampled_from([Commands.relative_deg, Commands.absolute_rad]))
    top_mps = np.array([get_platform(kind).max_speed_mps for kind in fleet.platforms])
    for _ in range(2):
        decisions = shield.decide(fleet, make(data.draw(any_commands(len(fleet)))))
        changed, commanded_mps = decisions.intervened, decisions.nominal.values[:, 0]
        sent_mps, sent_deg = decisions.filtered.as_relative_deg(fleet.state[:, L.HEADING]).T
        within = (sent_mps >= -ROUNDING_MPS) & (sent_mps <= top_mps + ROUNDING_MPS)  # as nominal commands pass
        assert (within | (sent_mps == commanded_mps))[changed].all()
        assert (np.abs(sent_deg) <= 180.0)[changed].all()
        own = fleet.controlled
        assert np.isfinite(decisions.filtered.values[own]).all()
        assert not np.isnan(decisions.safety_margin_m).any()
        assert not np.isnan(decisions.slack_m).any()
        assert (decisions.slack_m >= 0.0).all()
        for decision in decisions:
            assert decision.reason in Reason
            assert own[fleet.names.index(decision.boat)] == (decision.reason != Reason.NOT_COVERED)


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("make", [Commands.relative_deg, Commands.absolute_rad])
def test_a_command_that_is_none_holds_the_boat(value, column, make):
    values = np.array([[1.0, 0.1], [1.0, 0.1]])
    values[0, column] = value
    fleet = fleet_of([(0, 0, 30.0, 1.0), (400, 0, 0, 1.0)], [0, 0])
    decision, other = Shield().decide(fleet, make(values))
    assert decision.reason is Reason.HELD
    assert decision.fallback == "hold"
    assert decision.intervened
    assert decision.filtered_speed_mps == 0.0
    assert decision.filtered_heading_rad == pytest.approx(math.radians(30.0))
    assert other.reason is Reason.PASSED


def test_a_boat_that_cannot_simply_stop_is_not_left_drifting_in():
    """Without a command and with another boat coming: a stop would be run down, so it gets out of the way."""
    fleet = head_on(7.0)
    shield = Shield(adversary_horizon_s=0.0)
    decision = shield.decide(fleet, relative((math.nan, 0.0), (2.0, 0.0)))[0]
    assert decision.intervened
    assert math.isfinite(decision.filtered_speed_mps + decision.filtered_heading_rad)
    assert math.isnan(decision.nominal_speed_mps)


@settings(parent=quick, max_examples=40)
@given(st.integers(0, 2**31), st.booleans(), st.sampled_from(["turning_circle", "value_table"]))
def test_a_batch_never_answers_anything_but_numbers(seed, crowded, certificate):
    random = np.random.default_rng(seed)
    platforms = ("heron", "surveyor", "si", "di")
    shield = BatchedShield(ShieldConfig(opponent_model=certificate), 3, platforms, (0, 0, 1, 0), HARBOUR)
    state = np.zeros((3, 4, L.N_STATE))
    state[..., : L.Y + 1] = random.uniform(-4.0, 4.0, (3, 4, 2)) * (0.0 if crowded else 1.0)
    state[..., L.HEADING] = random.uniform(-180.0, 180.0, (3, 4))
    state[..., L.SPEED] = random.uniform(0.0, 2.0, (3, 4))
    wanted = random.choice([0.0, 1.0, -3.0, 200.0, *BAD], (3, 4, 2))
    sent = shield.decide(state, wanted, np.ones((3, 4), bool))
    assert np.isfinite(sent).all()
    assert (shield.reason != Reason.PASSED)[~np.isfinite(wanted).all(axis=-1)].all()
    assert not np.isnan(shield.safety_margin_m).any()
    alone = shield.decide(state, wanted, np.zeros((3, 4), bool))
    assert bits(alone) == bits(wanted), "boats that are not ours are told what was wanted"
