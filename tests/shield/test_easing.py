"""What a backup need not do is given back: all of it is the nominal command itself, and says so."""

import numpy as np
from shield_loops import sail, scattered
from shield_scenes import SEEN, fleet_of
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.decision import SOLVERS


def test_who_is_sent_what_it_wants_is_told_so():
    """Six herons with wants of their own, no opponents: no nominal command sent bit for bit is said to be changed."""
    backed_up = blended = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        state = scattered(random, 1, ["heron"] * 6, 20.0, gap_m=3.0, speed=(0.0, 1.0))[0]
        wants = np.column_stack([random.uniform(0.5, 2.0, 6), random.uniform(-60.0, 60.0, 6)])
        run = sail(
            Shield(ShieldConfig()), fleet_of(state[:, SEEN], [0] * 6), lambda _step, _state, wants=wants: wants, 60
        )
        on_backup = (run.reason == Reason.BACKUP) | (run.reason == Reason.LEAST_CHANGE)
        backed_up += on_backup.sum()
        blended += ((run.reason == Reason.LEAST_CHANGE) & (run.solver == SOLVERS.index("line_search"))).sum()
        changed = np.abs(run.sent - wants).max(axis=-1)
        assert (changed[on_backup] > 1e-6).all()
    assert backed_up > 100
    assert blended > 10
