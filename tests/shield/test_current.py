"""A current that nobody knows the direction of must not carry a boat into what it keeps clear of."""

import numpy as np
import pytest
from shield_loops import packed, step_all
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import layout as L

GAMES, STEPS, CURRENT_MPS, RADIUS = 12, 250, 0.3, 4.0
EDGE = 60.0


def deepest(name, top, told_mps):
    """How far boats that make for a circle and the edge behind it got into either, m, over currents from all sides."""
    around = Surroundings(field=(-EDGE, -EDGE, EDGE, EDGE), stops=[(0.0, 0.0, RADIUS)])
    config = ShieldConfig(current_mps=told_mps, edge_m=0.0)
    shield = BatchedShield(config, GAMES, (name,), (0,), around)
    angles = np.linspace(0.0, 2.0 * np.pi, GAMES, endpoint=False)
    drift = CURRENT_MPS * config.dt_s * np.column_stack([np.sin(angles), np.cos(angles)])
    state = np.zeros((GAMES, 1, L.N_STATE))
    state[:, 0, L.X], state[:, 0, L.Y] = np.linspace(-3.0, 3.0, GAMES), -40.0
    state[:, 0, L.SPEED], state[:, 0, L.THRUST] = top, 100.0
    into_circle, over_edge = -np.inf, -np.inf
    for _ in range(STEPS):
        wanted = np.zeros((GAMES, 1, 2))
        wanted[:, 0, 0], wanted[:, 0, 1] = top, -state[:, 0, L.HEADING]
        sent = shield.decide(state, wanted, np.ones((GAMES, 1), bool))
        state[:, 0, :2] += drift
        step_all(packed([name]), state, sent, config.dt_s)
        into_circle = max(into_circle, (RADIUS - np.linalg.norm(state[:, 0, :2], axis=1)).max())
        over_edge = max(over_edge, (np.abs(state[:, 0, :2]) - EDGE).max())
    return into_circle, over_edge


@pytest.mark.parametrize(("name", "top"), [("heron", 2.0), ("surveyor", 3.0)])
def test_a_boat_told_of_the_current_stays_out(name, top):
    unaware, told = deepest(name, top, 0.0), deepest(name, top, CURRENT_MPS)
    assert max(unaware) > 0.0  # or the test would see nothing
    assert max(told) < 0.0


@pytest.mark.parametrize(("name", "top"), [("heron", 2.0), ("surveyor", 3.0)])
@pytest.mark.parametrize("inside_m", [0.05, 0.2, 0.6])
def test_a_boat_that_begins_too_near_to_a_wall_comes_away(name, top, inside_m):
    """Nothing is remembered of a backup, and all manoeuvres fail at once: the one that leaves must still be found."""
    wall = [(0.0, -50.0), (0.0, 150.0), (-1.0, 150.0), (-1.0, -50.0)]
    config = ShieldConfig(current_mps=CURRENT_MPS)
    kept_m = Surroundings(polygons=[wall]).pack(config).segment_m
    shield = BatchedShield(config, 1, (name,), (0,), Surroundings(polygons=[wall]))
    state = np.zeros((1, 1, L.N_STATE))
    state[0, 0, [L.X, L.SPEED, L.THRUST]] = kept_m - inside_m, top, 100.0
    nearest = np.inf
    for _ in range(80):
        wanted = np.array([[[top, 90.0 - state[0, 0, L.HEADING]]]])
        sent = shield.decide(state, wanted, np.ones((1, 1), bool))
        state[0, 0, L.X] -= CURRENT_MPS * config.dt_s
        step_all(packed([name]), state, sent, config.dt_s)
        nearest = min(nearest, state[0, 0, L.X])
    assert nearest > kept_m - inside_m - 0.5
    assert state[0, 0, L.X] > kept_m + 1.0


def test_fixed_things_are_widened_by_the_drift_until_a_command_acts():
    around = Surroundings((0.0, 0.0, 80.0, 40.0), [(20.0, 20.0, 2.0)], keep_out=[(50.0, 20.0, 3.0)])
    still, told = (around.pack(ShieldConfig(delay_s=0.4, current_mps=mps)) for mps in (0.0, 0.6))
    np.testing.assert_allclose(told.field - still.field, [0.9, 0.9, -0.9, -0.9])
    np.testing.assert_allclose(told.circles[:, 2] - still.circles[:, 2], 0.9)
    np.testing.assert_allclose(told.keep_out[:, 2] - still.keep_out[:, 2], 0.9)
    assert (still.current_mps, told.current_mps) == (0.0, 0.6)
