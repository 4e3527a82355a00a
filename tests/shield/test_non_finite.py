"""Nothing that is not a number ever comes out, and what goes in without being one is held or refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shield_scenes import any_commands, bits, fleet_of, fleets, head_on, quick, relative
from steerclear.shield import Commands, Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.commands import ROUNDING_MPS
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

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
        changed, wanted_mps = decisions.intervened, decisions.nominal.values[:, 0]
        sent_mps, sent_deg = decisions.filtered.as_relative_deg(fleet.state[:, L.HEADING]).T
        within = (sent_mps >= -ROUNDING_MPS) & (sent_mps <= top_mps + ROUNDING_MPS)  # as nominal commands pass
        assert (within | (sent_mps == wanted_mps))[changed].all()
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
