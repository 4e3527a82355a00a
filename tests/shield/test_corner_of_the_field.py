"""Teammates that all want to the same corner of the field keep clear of each other, and hardly ever leave it."""

import numpy as np
import pytest
from shield_loops import sail_games, scattered
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

FIELD = (0.0, 0.0, 160.0, 80.0)
CORNER = np.array([160.0, 0.0])
GAMES, STEPS = 96, 800


def press(platform, boats):
    """Positions (T+1, GAMES, boats, 2) m of boats that steer for the corner at top speed."""
    side_m, gap_m = (20.0, 4.0) if platform == "heron" else (40.0, 15.0)
    state = scattered(np.random.default_rng(1), GAMES, [platform] * boats, side_m, gap_m=gap_m, speed=(0.3, 1.0))
    state[..., :2] += (115.0, 15.0)
    top = get_platform(platform).max_speed_mps

    def wanted(step, state):
        east, north = np.moveaxis(CORNER - state[..., :2], -1, 0)
        error = (np.degrees(np.arctan2(east, north)) - state[..., L.HEADING] + 180.0) % 360.0 - 180.0
        return np.stack([np.full(error.shape, top), error], axis=-1)

    around = Surroundings(field=FIELD)
    run = sail_games(ShieldConfig(), state, [platform] * boats, [0] * boats, wanted, STEPS, surroundings=around)
    return run.position, run.closest(np.ones(boats, bool))


@pytest.mark.parametrize(("platform", "boats"), [("heron", 2), ("heron", 3), ("surveyor", 3)])
def test_boats_that_press_into_one_corner(platform, boats):
    """Where nothing but a turn towards a mate is left they give way beyond the edge, in few games and not far."""
    position, closest_m = press(platform, boats)
    assert closest_m.min() >= 2.5
    inside_m = np.minimum(position - FIELD[:2], np.array(FIELD[2:]) - position).min(axis=(0, 2, 3))
    assert (inside_m < (-1.0 if platform == "heron" else -1.5)).mean() <= 0.04
    assert inside_m.min() >= -2.0
    assert (inside_m < 0.0).mean() <= (0.03 if platform == "heron" else 0.1)
    reached_m = np.linalg.norm(position - CORNER, axis=-1).min(axis=(0, 2))
    assert reached_m.max() < 5.0, "in some game nobody came to the corner"
