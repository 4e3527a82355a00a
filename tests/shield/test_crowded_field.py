"""Teammates that wander about a field hardly large enough for them keep clear of each other, and all but inside."""

import numpy as np
import pytest
from shield_loops import Wander, sail_games, scattered
from steerclear.shield import ShieldConfig, Surroundings

GAMES, STEPS = 30, 700


@pytest.mark.parametrize(
    ("platform", "boats", "side_m", "gap_m"), [("heron", 6, 40.0, 6.0), ("surveyor", 4, 60.0, 12.0)]
)
def test_boats_that_wander_about_a_small_field(platform, boats, side_m, gap_m):
    random = np.random.default_rng(12)
    state = scattered(random, GAMES, [platform] * boats, side_m - 12.0, gap_m=gap_m, speed=(0.0, 0.5))
    state[..., :2] += 6.0
    wanted = Wander(12, GAMES, [platform] * boats, hold_s=4.0)
    around = Surroundings(field=(0.0, 0.0, side_m, side_m))
    run = sail_games(ShieldConfig(), state, [platform] * boats, [0] * boats, wanted, STEPS, surroundings=around)
    assert run.closest(np.ones(boats, bool)).min() >= 2.5
    inside_m = np.minimum(run.position, side_m - run.position).min(axis=(0, 2, 3))
    assert (inside_m >= 0.0).mean() >= 0.95
    assert inside_m.min() >= -0.5
    assert (run.reason > 0).mean() < 0.25
