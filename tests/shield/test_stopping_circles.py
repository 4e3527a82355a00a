"""A boat that flees must not flee into a circle at which the game stops it."""

import numpy as np
import pytest
from shield_loops import packed, step_all
from steerclear.env.motion import keep_out
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.platforms import layout as L

GAMES, STEPS = 12, 200
HOME, RADIUS = np.array([0.0, 0.0]), 5.0


def pursued_before_the_circle(name, top, gap_m):
    """A boat at half speed bound for the circle from 9 to 12 m, and one at full speed behind it."""
    random = np.random.default_rng(4)
    state = np.zeros((GAMES, 2, L.N_STATE))
    for game in state:
        bearing, aside = random.uniform(0.0, 2.0 * np.pi), random.uniform(-25.0, 25.0)
        away = np.array([np.sin(bearing), np.cos(bearing)])
        game[0, :2] = away * (RADIUS + random.uniform(9.0, 12.0))
        game[0, L.HEADING] = (np.degrees(bearing) + 180.0 + aside + 180.0) % 360.0 - 180.0
        game[1, :2] = game[0, :2] + away * gap_m
        game[1, L.HEADING] = (np.degrees(bearing) + 360.0) % 360.0 - 180.0
        game[:, L.SPEED], game[:, L.THRUST] = (0.5 * top, top), 100.0
    return state


def chase(state, pursuer_mps):
    """Commands (B, 2, 2): hold on at full speed, and straight at the boat."""
    way = state[:, 0, :2] - state[:, 1, :2]
    bearing = np.degrees(np.arctan2(way[:, 0], way[:, 1]))
    commands = np.zeros((len(state), 2, 2))
    commands[:, 0, 0], commands[:, 1, 0] = pursuer_mps, pursuer_mps
    commands[:, 1, 1] = (bearing - state[:, 1, L.HEADING] + 180.0) % 360.0 - 180.0
    return commands


@pytest.mark.parametrize(("name", "top", "gap_m"), [("surveyor", 3.0, 24.0), ("heron", 2.0, 10.0)])
def test_a_pursued_boat_goes_round_the_circle(name, top, gap_m):
    state = pursued_before_the_circle(name, top, gap_m)
    around = Surroundings(stops=[(*HOME, RADIUS + 0.1)])
    shield = BatchedShield(ShieldConfig(), GAMES, (name, name), (0, 1), around)
    params, ours = packed([name, name]), np.tile([True, False], (GAMES, 1))
    stopped, closest = np.zeros(GAMES, bool), np.full(GAMES, np.inf)
    first = None
    for _ in range(STEPS):
        sent = shield.decide(state, chase(state, top), ours)
        first = shield.safety_margin_m[:, 0].copy() if first is None else first
        before = state[:, 0, :2].copy()
        step_all(params, state, sent, 0.1)
        for b in range(GAMES):
            if np.linalg.norm(state[b, 0, :2] - HOME) < RADIUS:
                keep_out(state[b, 0], before[b], HOME, RADIUS)
                stopped[b] = True
        closest = np.minimum(closest, np.linalg.norm(state[:, 0, :2] - state[:, 1, :2], axis=1))
    certified = first >= 0.0
    assert certified.sum() >= GAMES // 2
    assert not stopped[certified].any()
    assert (closest[certified] >= 2.5).all()
