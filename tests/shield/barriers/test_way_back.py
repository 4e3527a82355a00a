"""A boat that is beyond something kept by rule is led back, whatever is wanted of it, and breaks nothing else."""

import numpy as np
import pytest
from shield_loops import on_course, sail_games, scattered
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

RADIUS_M = 8.0
BOWS_DEG = np.linspace(-180.0, 120.0, 6)
DEPTHS_M = (0.01, 3.0)
PLATFORMS = ("heron", "surveyor", "otter", "blueboat")
LONG_S = 60


def lying(x_m, y_m, bow_deg):
    return fresh_state(x_m, y_m, bow_deg, 0.0)[None]


def sailed(platform, state, wanted_share, wanted_deg, seconds=LONG_S, **around):
    """Where boats get, (T, games, 2) m, that want a course at a share of top speed."""
    wanted = on_course(wanted_deg, wanted_share * get_platform(platform).max_speed_mps)
    around = Surroundings(**around)
    return sail_games(
        ShieldConfig(obstacle_clearance_m=0.0), state, [platform], [0], wanted, 10 * seconds, surroundings=around
    ).position[:, :, 0]


@pytest.mark.parametrize("wanted_share", [0.0, 1.0])
@pytest.mark.parametrize("platform", PLATFORMS)
def test_over_the_edge_and_back(platform, wanted_share):
    """Boats that lie beyond the eastern edge, their bows all ways, and want to stay, or to go on eastwards."""
    state = np.stack([lying(50.0 + depth, 0.0, bow) for depth in DEPTHS_M for bow in BOWS_DEG])
    place = sailed(platform, state, wanted_share, 90.0, field=(-50.0, -50.0, 50.0, 50.0))
    assert (place[:, :, 0].min(axis=0) <= 50.0).all()


@pytest.mark.parametrize("wanted_share", [0.0, 1.0])
@pytest.mark.parametrize("platform", PLATFORMS)
def test_out_of_a_keep_out_circle(platform, wanted_share):
    state = np.stack([lying(RADIUS_M - depth, 0.0, bow) for depth in DEPTHS_M for bow in BOWS_DEG])
    place = sailed(platform, state, wanted_share, 270.0, keep_out=[(0.0, 0.0, RADIUS_M)])
    assert (np.linalg.norm(place, axis=-1).max(axis=0) >= RADIUS_M).all()


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_who_can_get_out_only_over_the_edge_stays_in_the_field(platform):
    """A keep-out circle about the whole field, and one beside an edge."""
    state = np.stack([lying(x, 0.0, bow) for x in (20.0, 40.0) for bow in BOWS_DEG])
    field = (-50.0, -50.0, 50.0, 50.0)
    for circle in ((0.0, 0.0, 400.0), (40.0, 0.0, 30.0)):
        place = sailed(platform, state, 0.0, 90.0, seconds=40, field=field, keep_out=[circle])
        assert np.abs(place).max() <= 50.0


@pytest.mark.parametrize("kind", ["circles", "stops"])
@pytest.mark.parametrize("wanted_share", [0.0, 1.0])
def test_in_an_obstacle_nobody_goes_deeper_and_who_wants_out_may(kind, wanted_share):
    state = np.stack([lying(5.0, 0.0, bow) for bow in BOWS_DEG])
    inwards = sailed("heron", state, wanted_share, 270.0, **{kind: [(0.0, 0.0, RADIUS_M)]})
    assert np.linalg.norm(inwards, axis=-1).min() > 4.9
    outwards = sailed("heron", state[np.abs(BOWS_DEG - 90.0) < 80.0], 1.0, 90.0, **{kind: [(0.0, 0.0, RADIUS_M)]})
    assert (np.linalg.norm(outwards[-1], axis=-1) > RADIUS_M).all()


def test_a_boat_chased_out_over_a_corner_goes_round_its_pursuer_and_comes_back():
    """One at 0.7 of its speed: by each side alone it turned to and fro between the two, 88 m out."""
    kinds, team, field = ("heron",) * 2, (0, 1), (0.0, 0.0, 80.0, 40.0)
    config = ShieldConfig(profile="ramming")
    state = scattered(np.random.default_rng(0), 4, kinds, 10.0, gap_m=4.0)
    state[:, :, L.X] = [[81.0, 78.0], [82.0, 80.0], [-1.0, 2.0], [82.0, 78.0]]
    state[:, :, L.Y] = [[41.0, 38.0], [42.0, 38.0], [-1.0, 2.0], [-2.0, 2.0]]
    state[:, :, L.HEADING] = np.array([45.0, 45.0, -135.0, 135.0])[:, None]
    state[:, :, L.SPEED] = 2.0, 1.4

    def chase(step, now):
        to = now[:, 0, :2] - now[:, 1, :2]
        home = np.array([40.0, 20.0]) - now[:, 0, :2]
        way = np.degrees(np.stack([np.arctan2(*home.T), np.arctan2(*to.T)], axis=1)) - now[..., L.HEADING]
        return np.stack([np.tile([2.0, 1.4], (4, 1)), (way + 180.0) % 360.0 - 180.0], axis=-1)

    run = sail_games(config, state, kinds, team, chase, 600, surroundings=Surroundings(field=field))
    x, y = run.position[:, :, 0, 0], run.position[:, :, 0, 1]
    outside_m = np.hypot(np.maximum(0.0, np.maximum(-x, x - 80.0)), np.maximum(0.0, np.maximum(-y, y - 40.0)))
    assert outside_m.max() <= 25.0
    assert (outside_m[-100:].min(axis=0) <= 0.2).all()
    assert run.closest(np.array([True, False])).min() >= 2.5
