"""Pairs too far apart to matter are left out; nothing changes when they are not."""

import numpy as np
import pytest
from shield_scenes import bits, fleet_of, relative
from steerclear.shield import Reason, Shield, Surroundings


@pytest.mark.parametrize("away_m", [200.0, 300.0, 1e4, 1e8])
@pytest.mark.parametrize("team", [0, 1])
def test_a_boat_far_away_never_changes_a_decision(away_m, team):
    random = np.random.default_rng(3)
    for _ in range(20):
        rows = [(0.0, 0.0, 0.0, 2.0), (*random.uniform(-8.0, 8.0, 2), random.uniform(-180.0, 180.0), 2.0)]
        wanted = [(random.uniform(0.0, 2.0), random.uniform(-180.0, 180.0)) for _ in range(3)]
        bearing = random.uniform(0.0, 2.0 * np.pi)
        far = (away_m * np.sin(bearing), away_m * np.cos(bearing), random.uniform(-180.0, 180.0), 2.0)
        alone = Shield().decide(fleet_of(rows, [0, 1]), relative(*wanted[:2]))
        crowd = Shield().decide(fleet_of([*rows, far], [0, 1, team]), relative(*wanted))
        assert bits(alone.filtered.values) == bits(crowd.filtered.values[:2])
        assert alone.reason.tolist() == crowd.reason[:2].tolist()
        assert alone.safety_margin_m[0] == crowd.safety_margin_m[0]


def test_hundreds_of_boats_that_all_have_to_move_are_decided_for():
    """More rows than a program may have: the ladder takes over, and says so for every boat."""
    n = 620
    rows = [(200.0 * (i % 25), 200.0 * (i // 25), 0.0, 5.0) for i in range(n)]
    shield = Shield(surroundings=Surroundings(keep_out=[(2500.0, 2500.0, 1e5)]))
    decisions = shield.decide(fleet_of(rows, [0] * n, "si"), relative(*[(10.0, 0.0)] * n))
    assert np.isfinite(decisions.filtered.values).all()
    assert (decisions.reason != Reason.PASSED).all()
