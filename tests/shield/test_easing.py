"""Least changes: answers of the program between teammates, and what a backup need not do, which is given back."""

import numpy as np
from shield_loops import sail, scattered
from shield_scenes import SEEN, fleet_of
from steerclear.shield import Reason, Shield
from steerclear.shield.decision import SOLVERS


def herons(seed, side_m, gap_m, speed, turn_deg, steps):
    """Six herons of ours with wants of their own, and how they sail."""
    random = np.random.default_rng(seed)
    state = scattered(random, 1, ["heron"] * 6, side_m, gap_m=gap_m, speed=(0.0, 1.0))[0]
    wants = np.column_stack([random.uniform(*speed, 6), random.uniform(-turn_deg, turn_deg, 6)])
    return wants, sail(Shield(), fleet_of(state[:, SEEN], [0] * 6), lambda _step, _state: wants, steps)


def test_answers_are_sent_between_team_mates_and_none_comes_too_near():
    answered = 0
    for seed in range(40):
        wants, run = herons(seed, 24.0, 4.0, (0.5, 2.0), 20.0, 80)
        by_program = run.solver == SOLVERS.index("qp")
        assert (run.reason[by_program] == Reason.LEAST_CHANGE).all()
        answered += by_program.sum()
        assert (run.safety_margin_m[by_program] >= 0.0).all()
        assert (np.abs(run.sent - wants).max(axis=-1)[by_program] > 0.0).all()
    assert answered > 5


def test_who_is_sent_what_it_wants_is_told_so():
    """No nominal command sent bit for bit is said to be changed."""
    backed_up = blended = 0
    for seed in range(40):
        wants, run = herons(seed, 20.0, 3.0, (0.5, 2.0), 60.0, 60)
        on_backup = (run.reason == Reason.BACKUP) | (run.reason == Reason.LEAST_CHANGE)
        backed_up += on_backup.sum()
        blended += ((run.reason == Reason.LEAST_CHANGE) & (run.solver == SOLVERS.index("line_search"))).sum()
        assert (np.abs(run.sent - wants).max(axis=-1)[on_backup] > 1e-6).all()
    assert backed_up > 100
    assert blended > 10
