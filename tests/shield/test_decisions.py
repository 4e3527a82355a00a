"""Contracts of one decision: what is safe passes bit for bit, what is not usable never comes out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shield_scenes import fleet_of, fleets, head_on, quick, relative
from steerclear.shield import Commands, Fleet, Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import ConfigError, FleetError, SteerclearError


def wanted_for(n, seed):
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(0, 3, n), rng.uniform(-180, 180, n)], axis=1)


@quick
@given(fleet=fleets(), seed=st.integers(0, 10_000))
def test_what_is_not_changed_is_sent_bit_for_bit_and_all_is_finite(fleet, seed):
    wanted = Commands.relative_deg(wanted_for(len(fleet), seed))
    decisions = Shield().decide(fleet, wanted)
    assert np.isfinite(decisions.filtered.values).all()
    same = ~decisions.intervened
    assert decisions.filtered.values[same].tobytes() == wanted.values[same].tobytes()
    assert not decisions.intervened[~fleet.controlled].any()


@quick
@given(fleet=fleets(), bad=st.sampled_from([np.nan, np.inf, -np.inf]), column=st.integers(0, 1))
def test_a_command_that_is_no_number_is_held(fleet, bad, column):
    values = wanted_for(len(fleet), 1)
    values[:, column] = bad
    decisions = Shield().decide(fleet, Commands.relative_deg(values))
    ours = fleet.controlled
    assert np.isfinite(decisions.filtered.values[ours]).all()
    assert Reason.PASSED not in decisions.reason[ours]


@pytest.mark.parametrize("frame", ["relative", "absolute"])
def test_signed_zeros_and_tiny_numbers_pass_as_they_are(frame):
    make = Commands.relative_deg if frame == "relative" else Commands.absolute_rad
    wanted = make([[1.5, -0.0], [5e-324, 0.1]])
    fleet = fleet_of([(0, 0, 0, 1), (60, 0, 0, 1)], [0, 0])
    assert Shield().decide(fleet, wanted).filtered.values.tobytes() == wanted.values.tobytes()


def test_the_same_inputs_give_the_same_bits():
    runs = []
    for _ in range(2):
        shield = Shield()
        runs.append(
            [shield.decide(head_on(gap), relative((2, 0), (2, 0))).filtered.values.tobytes() for gap in (6, 5.5, 5)]
        )
    assert runs[0] == runs[1]


def test_a_boat_far_away_changes_nothing():
    near = [(0, 0, 0, 2), (0, 5.5, 180, 2)]
    alone = Shield().decide(fleet_of(near, [0, 1]), relative((2, 0), (2, 0)))
    crowd = fleet_of([*near, (900, 900, 0, 2)], [0, 1, 1])
    both = Shield().decide(crowd, relative((2, 0), (2, 0), (2, 0)))
    assert alone.intervened[0]
    assert alone.filtered.values[0].tobytes() == both.filtered.values[0].tobytes()


def test_mirrored_water_gives_the_mirrored_command():
    left = Shield().decide(fleet_of([(0, 0, 0, 2), (0.7, 5.1, 180, 2)], [0, 1]), relative((2, 5), (2, 0)))
    right = Shield().decide(fleet_of([(0, 0, 0, 2), (-0.7, 5.1, 180, 2)], [0, 1]), relative((2, -5), (2, 0)))
    assert left.intervened[0]
    np.testing.assert_allclose(left.filtered.values[0] * [1, -1], right.filtered.values[0], atol=1e-9)


def test_a_decision_says_everything():
    decision = Shield().decide(head_on(5.5), relative((2, 0), (2, 0)))[0]
    assert decision.reason in (Reason.LEAST_CHANGE, Reason.BACKUP)
    assert decision.active_constraints == ("boat_1",)
    assert decision.safety_margin_m >= 0
    assert decision.solver == (None if decision.reason is Reason.BACKUP else "line_search")
    assert decision.filtered_heading_rad != decision.nominal_heading_rad


def test_in_breach_the_boats_part():
    shield, rows = Shield(), [(0.0, 0.0, 0.0, 1.5), (1.5, 0.5, 180.0, 1.5)]
    decision = shield.decide(fleet_of(rows, [0, 0]), relative((2, 0), (2, 0)))
    assert set(decision.reason) == {Reason.BEST_EFFORT}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"state": np.zeros((2, 3))}, "state has shape"),
        ({"team": np.zeros(3, np.int64)}, "team has shape"),
        ({"age_s": np.array([0.0, 9.0])}, "9.00 s old"),
        ({"age_s": np.array([0.0, np.nan])}, "age_s"),
    ],
)
def test_unusable_fleets_are_refused(change, text):
    fleet = head_on()
    parts = {name: getattr(fleet, name) for name in ("state", "team", "platforms", "controlled", "names")}
    with pytest.raises(FleetError, match=text):
        Shield().decide(Fleet(**(parts | change)), relative((2, 0), (2, 0)))


@pytest.mark.parametrize("column", range(4))
def test_a_state_that_is_no_number_is_refused(column):
    fleet = head_on()
    fleet.state[1, column] = np.nan
    with pytest.raises(FleetError, match="boat_1"):
        Shield().decide(fleet, relative((2, 0), (2, 0)))


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"separation": 2.0}, "did you mean 'separation_m'"),
        ({"separation_m": -1.0}, "must be > 0"),
        ({"separation_m": float("nan")}, "give a number"),
        ({"adversary_horizon_s": -2.0}, ">= 0"),
        ({"opponent_model": "magic"}, "turning_circle"),
        ({"solver": "nosuch"}, "installed"),
        ({"coordination": "chaos"}, "team, per_boat"),
    ],
)
def test_settings_are_checked(settings, text):
    with pytest.raises(SteerclearError, match=text):
        ShieldConfig.of(**settings)


def test_bad_surroundings_are_refused():
    with pytest.raises(ConfigError, match="negative radius"):
        Surroundings(circles=[(0, 0, -1)])
    with pytest.raises(ConfigError, match="empty"):
        Surroundings(field=(0, 0, 0, 5))


def test_a_batch_refuses_what_it_cannot_honour():
    with pytest.raises(ConfigError, match="coordination='team'"):
        BatchedShield(ShieldConfig(coordination="per_boat"), 1, ("heron",), (0,))


def test_decisions_that_say_the_same_are_equal_however_long_they_took():
    one, other = (Shield().decide(head_on(5.5), relative((2, 0), (2, 0)))[0] for _ in range(2))
    slow = replace(other, solve_time_s=9.0)
    assert one == slow
    assert hash(one) == hash(slow)
    assert one != replace(other, slack_m=0.5)
    assert one != "decision"
    nobody = replace(one, nominal_heading_rad=float("nan"))
    assert nobody == replace(one, nominal_heading_rad=float("inf") - float("inf"))
    assert hash(nobody) == hash(replace(nobody, solve_time_s=1.0))
    assert nobody != one
