"""One decision after another: a single one is a batch of one, and each boat that decides for itself has its own."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import fill, packed, step_all
from shield_scenes import bits, fleet_of, relative
from steerclear.shield import Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.commands import Commands

TEAM = (0, 0, 0, 1, 1)


def crowd(seed):
    """Three herons of ours among two opponents, in 15 m."""
    random = np.random.default_rng(seed)
    rows = np.column_stack(
        [random.uniform(0.0, 15.0, (5, 2)), random.uniform(-180.0, 180.0, 5), random.uniform(0.5, 2.0, 5)]
    )
    fleet = fleet_of(rows, TEAM)
    fill(fleet.state, packed(fleet.platforms))
    return fleet


@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_a_single_decision_is_a_batch_of_one_bit_for_bit(delay_s):
    config = ShieldConfig(delay_s=delay_s)
    single, batch = Shield(config), BatchedShield(config, 2, ("heron",) * 5, TEAM)
    fleets, changed = [crowd(1), crowd(2)], 0
    states = np.stack([fleet.state for fleet in fleets])
    singles = [single, copy.deepcopy(single)]
    ours = np.array([fleet.controlled for fleet in fleets])
    for step in range(60):
        wanted = np.random.default_rng(step).uniform([0.0, -90.0], [2.0, 90.0], (2, 5, 2))
        sent = batch.decide(states, wanted, ours).copy()
        for game, guard in enumerate(singles):
            answer = guard.decide(replace(fleets[game], state=states[game].copy()), Commands.game_deg(wanted[game]))
            assert bits(answer.filtered.values) == bits(sent[game])
            assert bits(answer.safety_margin_m) == bits(batch.safety_margin_m[game])
            assert (answer.reason == batch.reason[game]).all()
            changed += int(answer.intervened.sum())
        if step == 30:  # copies go on as what they are copies of
            batch, singles = copy.deepcopy(batch), pickle.loads(pickle.dumps(singles))
        step_all(packed(("heron",) * 5), states, sent, 0.1)
    assert changed > 20


@pytest.mark.parametrize("threads", [2, 9])
def test_threads_share_the_games_of_a_batch_and_another_goes_on_from_what_it_remembered(threads):
    """Without what is remembered the same states and commands are decided otherwise, so it does matter."""
    config, otherwise = ShieldConfig(delay_s=0.2), 0
    alone, shared, late, fresh = (BatchedShield(config, 7, ("heron",) * 5, TEAM, threads=k) for k in (1, threads, 1, 1))
    states = np.stack([crowd(seed).state for seed in range(7)])
    ours, more = np.tile(np.array(TEAM) == 0, (7, 1)), states.copy()
    for step in range(40):
        wanted = np.random.default_rng(step).uniform([0.0, -90.0], [2.0, 90.0], (7, 5, 2))
        sent = alone.decide(states, wanted, ours)
        assert bits(sent) == bits(shared.decide(more, wanted, ours))
        assert bits(alone.safety_margin_m) == bits(shared.safety_margin_m)
        assert (alone.reason == shared.reason).all()
        if step > 20:
            assert bits(late.decide(states, wanted, ours)) == bits(sent)
            otherwise += (fresh.decide(states, wanted, ours) != sent).any()
        step_all(packed(("heron",) * 5), states, sent, 0.1)
        more[:] = states
        if step == 20:
            for name, values in late.remembered.items():
                values[...] = alone.remembered[name]
            shared = copy.deepcopy(shared)
            for batch in (alone, shared, late):
                batch.reset(np.arange(7) > 4)
    assert (alone.reason != Reason.PASSED).any()
    assert otherwise > 0


@pytest.mark.parametrize("teams", [(0, 1, -1), (-1, 1, 1)])
def test_whoever_is_of_no_team_of_ours_is_feared_whatever_its_number(teams):
    fleet = fleet_of([(0, 0, 0, 2.0), (20.0, 0, 0, 2.0), (10.0, 40.0, 180.0, 2.0)], teams)
    fleet = replace(fleet, controlled=np.array([True, True, False]))
    assert Shield().decide(fleet, relative(*[(2.0, 0.0)] * 3)).adversary_horizon_s[2] > 0.0


@pytest.mark.parametrize("solver", ["active_set", "daqp"])
@pytest.mark.parametrize("coordination", ["team", "per_boat"])
@pytest.mark.parametrize("delay_s", [0.0, 0.2])
@pytest.mark.filterwarnings("error")
def test_whatever_is_wanted_and_wherever_boats_are_what_is_sent_is_a_command(delay_s, coordination, solver):
    """Nobody, one boat, boats on one point; wanted is no number, or none that a boat could do."""
    around = Surroundings(field=(-20.0, -20.0, 20.0, 20.0), keep_out=((0.0, 5.0, 2.0),))
    for team in ([], [0], [0, 0], [0, 1], [0, 0, 1]):
        shield = Shield(surroundings=around, coordination=coordination, solver=solver, delay_s=delay_s)
        fleet = fleet_of([(0.0, 0.0, 0.0, 1.0)] * len(team), team)
        for value in (1.0, np.nan, np.inf, -np.inf, 1e9, -1e9):
            decisions = shield.decide(fleet, relative(*[(value, value)] * len(team)))
            sent, own = decisions.filtered.values[fleet.controlled], fleet.controlled
            assert (np.abs(sent) <= 1e6).all()
            assert (decisions.reason[own] != Reason.NOT_COVERED).all()
            assert np.isfinite(decisions.slack_m).all()
            if not np.isfinite(value):
                assert (decisions.reason[own] != Reason.PASSED).all()
