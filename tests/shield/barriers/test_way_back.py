"""A boat that is beyond a static constraint is led back, whatever is wanted of it."""

import math

import numpy as np
import pytest
from shield_loops import sail_games
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.barriers import Barrier, register_barrier, registry
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms.usv import fresh_state

RADIUS_M, START_M = 8.0, 5.0
OFF_OUTWARDS_DEG = np.linspace(-180.0, 150.0, 12)


def disc(x_m, y_m, ahead_s, values):
    return math.hypot(x_m, y_m) - values[0]


@pytest.fixture(autouse=True)
def nothing_stays_registered(monkeypatch):
    monkeypatch.setattr(registry, "BARRIERS", {})


def depths(platform, wanted_share, hull_m=0.0, barriers=(), **around):
    """How far out of the disc boats are, m, (T, games), that lie in it with their bows all ways and want to stay."""
    state = np.stack([fresh_state(START_M, 0.0, 90.0 + off, 0.0) for off in OFF_OUTWARDS_DEG])[:, None]
    speed = wanted_share * get_platform(platform).max_speed_mps

    def inwards(step, state):
        off = np.degrees(np.arctan2(-state[..., 0], -state[..., 1])) - state[..., 2]
        return np.stack([np.full(off.shape, speed), (off + 180.0) % 360.0 - 180.0], axis=-1)

    config = ShieldConfig(hull_m=hull_m, barriers=barriers)
    run = sail_games(config, state, [platform], [0], inwards, 400, surroundings=Surroundings(**around))
    return np.linalg.norm(run.position[:, :, 0], axis=-1) - RADIUS_M


@pytest.mark.parametrize("wanted_share", [0.0, 1.0])
@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_out_of_a_keep_out_circle(platform, wanted_share):
    out_m = depths(platform, wanted_share, keep_out=[(0.0, 0.0, RADIUS_M)])
    assert (out_m.max(axis=0) > -0.1).all()
    assert (out_m[-1] > -0.1).all(), "and they stay out"


@pytest.mark.parametrize("wanted_share", [0.0, 1.0])
@pytest.mark.parametrize("kind", ["circles", "registered"])
@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_out_of_what_stops_boats_where_the_way_leads_no_deeper(platform, kind, wanted_share):
    if kind == "circles":
        out_m = depths(platform, wanted_share, circles=[(0.0, 0.0, RADIUS_M)])
    else:
        register_barrier(Barrier("disc", disc, values=(RADIUS_M,)))
        out_m = depths(platform, wanted_share, barriers=("disc",))
    outwards = np.abs(OFF_OUTWARDS_DEG) < 80.0
    assert (out_m[-1, outwards] > -0.1).all()
    assert out_m.min() > START_M - RADIUS_M - 0.1, "nobody goes deeper"


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_off_a_wall(platform):
    """Boats that lie 1 m off a wall, of which 3 m are to be kept, their bows off it, and want to stay."""
    state = np.stack([fresh_state(1.0, 0.0, 90.0 + off, 0.0) for off in (-80.0, -40.0, 0.0, 60.0)])[:, None]
    wall = ((0.0, -90.0), (0.0, 90.0), (-0.5, 0.0))

    def still(step, state):
        return np.zeros((*state.shape[:-1], 2))

    config = ShieldConfig(hull_m=3.0)
    run = sail_games(config, state, [platform], [0], still, 400, surroundings=Surroundings(polygons=[wall]))
    assert (run.position[-1, :, 0, 0] > 2.9).all()
    assert run.position[..., 0].min() > 0.9
