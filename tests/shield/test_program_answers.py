"""Answers of the program are sent: between teammates, seldom, and only such as keep what the backups keep."""

import numpy as np
from shield_loops import sail, scattered
from shield_scenes import SEEN, fleet_of
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.decision import SOLVERS


def test_answers_are_sent_between_team_mates_and_none_comes_too_near():
    answered = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        state = scattered(random, 1, ["heron"] * 6, 24.0, gap_m=4.0, speed=(0.0, 1.0))[0]
        wants = np.column_stack([random.uniform(0.5, 2.0, 6), random.uniform(-20.0, 20.0, 6)])
        fleet = fleet_of(state[:, SEEN], [0] * 6)
        run = sail(Shield(ShieldConfig()), fleet, lambda _step, _state, wants=wants: wants, 80)
        by_program = run.solver == SOLVERS.index("qp")
        assert (run.reason[by_program] == Reason.LEAST_CHANGE).all()
        answered += by_program.sum()
        assert (run.safety_margin_m[by_program] >= 0.0).all()
        assert (np.abs(run.sent - wants).max(axis=-1)[by_program] > 0.0).all()
    assert answered > 5
