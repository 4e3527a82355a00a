"""Commands that take effect later: decisions are made for that moment, with the commands on their way."""

import numpy as np
import pytest
from shield_loops import fill, packed, step_all
from shield_scenes import head_on
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import layout as L

STEPS = 3


def sail_late(fleet, steps, believed_steps=STEPS):
    """Head-on run in which every command takes effect ``STEPS`` steps late; returns distances and sent commands."""
    params, state = packed(fleet.platforms), fleet.state.copy()
    fill(state, params)
    config = ShieldConfig(delay_s=0.1 * believed_steps, track_error_mps=0.0)
    decide = batch(config, fleet)
    queue = [np.column_stack([state[:, L.SPEED], state[:, L.HEADING]]) for _ in range(STEPS)]
    distance, sent = [], []
    for _ in range(steps):
        wanted = np.column_stack([np.full(len(state), 2.0), np.zeros(len(state))])
        out = decide(state, wanted)
        sent.append(out.copy())
        queue.append(np.column_stack([out[:, 0], state[:, L.HEADING] + out[:, 1]]))
        target = queue.pop(0)
        error = (target[:, 1] - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
        step_all(params, state[None], np.column_stack([target[:, 0], error])[None], 0.1)
        distance.append(np.hypot(*(state[0, :2] - state[1, :2])))
    return np.array(distance), np.array(sent)


def batch(config, fleet):
    shield = BatchedShield(config, 1, fleet.platforms, tuple(fleet.team))
    return lambda state, wanted: shield.decide(state[None], wanted[None], fleet.controlled[None])[0]


@pytest.mark.parametrize("platforms", ["heron", "surveyor"])
def test_the_distance_is_kept_when_the_delay_is_known(platforms):
    fleet = head_on(gap_m=60.0, platforms=platforms, aside_m=0.5)
    distance, sent = sail_late(fleet, 300)
    assert distance.min() >= 2.5
    assert (sent[:, 0, 1] != 0.0).any()


def test_a_delay_kept_from_the_shield_costs_distance():
    fleet = head_on(gap_m=60.0, aside_m=0.5)
    known, _ = sail_late(fleet, 300)
    unknown, _ = sail_late(fleet, 300, believed_steps=0)
    assert unknown.min() < known.min()


def test_safe_commands_pass_bit_for_bit():
    fleet = head_on(gap_m=300.0)
    decide = batch(ShieldConfig(delay_s=0.3), fleet)
    state = fleet.state.copy()
    fill(state, packed(fleet.platforms))
    random = np.random.default_rng(0)
    for _ in range(6):
        wanted = random.uniform([0.1, -170.0], [2.0, 170.0], (2, 2))
        assert (decide(state, wanted) == wanted).all()


@pytest.mark.parametrize("nonsense", [(2.0, np.nan), (np.inf, 0.0), (2.0, 1e300)])
def test_what_others_told_a_boat_before_it_was_ours_may_be_nonsense(nonsense):
    fleet = head_on(gap_m=4.0)
    shield = Shield(delay_s=0.1)
    taken = Fleet(fleet.state, fleet.team, fleet.platforms, np.array([False, False]), fleet.names)
    shield.decide(taken, Commands.relative_deg([nonsense, (2.0, 0.0)]))
    decision = shield.decide(fleet, Commands.relative_deg([(2.0, 0.0), (2.0, 0.0)]))[0]
    assert np.isfinite([decision.filtered_speed_mps, decision.filtered_heading_rad, decision.safety_margin_m]).all()
    assert decision.safety_margin_m < 0.0
