"""Boats that press through edges, walls and corners sail along them, steadily, and come back from beyond."""

import numpy as np
import pytest
from shield_loops import Wander, bearing_deg, on_course, sail_games, scattered
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.backup.paths import SAG_M
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

STEPS, SETTLED, GAMES = 900, 500, 12

COURSE = np.linspace(-180.0, 150.0, GAMES)

FIELD = (0.0, 0.0, 160.0, 80.0)

EDGE_M, HULL_M = 0.2, 1.0


def press(platform, start, course, surroundings, steps=STEPS):
    """Positions (T+1, B, 2), turns (T, B) deg and the speed (B,) at the end of boats that hold to a course (B,)."""
    top, headings, speeds = get_platform(platform).max_speed_mps, [], []

    def wanted(step, state):
        headings.append(state[:, 0, L.HEADING].copy())
        speeds.append(state[:, 0, L.SPEED].copy())
        error = (course(state[:, 0]) - state[:, 0, L.HEADING] + 180.0) % 360.0 - 180.0
        return np.stack([np.full(len(state), top), error], axis=-1)[:, None]

    config = ShieldConfig(edge_m=EDGE_M, obstacle_clearance_m=HULL_M)
    run = sail_games(config, start, [platform], [0], wanted, steps, surroundings=surroundings)
    turns = (np.diff(headings, axis=0) + 180.0) % 360.0 - 180.0
    return run.position[:, :, 0], turns, np.array(speeds)


def flips_per_min(turns):
    """How often the turn of a boat changes sides from one step to the next, per minute."""
    side = np.sign(np.where(np.abs(turns) < 0.2, 0.0, turns))
    return (side[1:] * side[:-1] < 0.0).sum(axis=0) * 600.0 / len(turns)


def begin(platform, x_m, y_m):
    """States of `GAMES` boats at random about a place."""
    state = scattered(np.random.default_rng(3), GAMES, [platform], 1.0, speed=(0.3, 1.0))
    random = np.random.default_rng(4)
    state[:, 0, 0] = random.uniform(*x_m, GAMES)
    state[:, 0, 1] = random.uniform(*y_m, GAMES)
    return state


@pytest.mark.parametrize(("platform", "share"), [("heron", 0.9), ("surveyor", 0.7)])
def test_along_the_edge_of_the_field(platform, share):
    start = begin(platform, (40.0, 120.0), (25.0, 55.0))
    position, turns, speed = press(platform, start, lambda boats: COURSE, Surroundings(field=FIELD))
    inside = np.minimum(position - FIELD[:2], np.array(FIELD[2:]) - position).min(axis=(0, 2))
    assert inside.min() >= EDGE_M - SAG_M - 1e-3
    assert np.median(flips_per_min(turns[SETTLED:])) < 60.0
    assert np.mean(speed[SETTLED:]) > share * get_platform(platform).max_speed_mps


@pytest.mark.parametrize(("platform", "share"), [("heron", 0.9), ("surveyor", 0.9)])
def test_along_a_wall(platform, share):
    quay = Surroundings(polygons=[[(-900.0, 0.0), (900.0, 0.0), (900.0, -5.0), (-900.0, -5.0)]])
    start, course = begin(platform, (-50.0, 50.0), (20.0, 45.0)), np.linspace(105.0, 255.0, GAMES)
    position, turns, speed = press(platform, start, lambda boats: course, quay)
    assert position[:, :, 1].min() >= HULL_M - SAG_M - 1e-3
    assert np.median(flips_per_min(turns[SETTLED:])) < 60.0
    assert np.mean(speed[SETTLED:]) > share * get_platform(platform).max_speed_mps


@pytest.mark.parametrize("rule", ["circles", "keep_out"])
def test_round_a_circle_it_wants_into(rule):
    radius_m = 14.0 + (HULL_M if rule == "keep_out" else 0.0)
    start = begin("heron", (-40.0, 40.0), (20.0, 45.0))

    def inwards(boats):
        return np.degrees(np.arctan2(-boats[:, 0], -boats[:, 1]))

    position, turns, speed = press("heron", start, inwards, Surroundings(**{rule: [(0.0, 0.0, radius_m)]}))
    assert np.hypot(*np.moveaxis(position, -1, 0)).min() >= 14.0 + HULL_M - SAG_M - 1e-3
    assert np.median(flips_per_min(turns[SETTLED:])) < 60.0
    assert np.mean(speed[SETTLED:]) > 1.8


def test_what_was_kept_from_other_things_is_not_asked_of_new_ones():
    """A keep-out circle that appears near a boat asks for no more than its backup, not for a margin it never had."""
    from shield_scenes import fleet_of
    from steerclear.shield import Commands, Shield

    fleet, wanted = fleet_of([(0.0, 0.0, 0.0, 2.0)], [0], "heron"), Commands.relative_deg([[2.0, 0.0]])
    near, far = ({"keep_out": [(0.0, y, 3.0)]} for y in (5.8, 60.0))
    shield = Shield(ShieldConfig())
    shield.decide(fleet, wanted, Surroundings(**far))
    assert not shield.decide(fleet, wanted, Surroundings(**near)).intervened[0]
    kept = Shield(ShieldConfig(), Surroundings(**near))
    assert not kept.decide(fleet, wanted).intervened[0]


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_a_boat_beyond_the_field_comes_back_at_speed_whatever_is_wanted(platform):
    """Turned back outwards in every other step it would come back, too, but in two minutes."""
    beyond_m = 30.0
    start = begin(platform, (40.0, 120.0), (FIELD[3] + beyond_m, FIELD[3] + beyond_m + 0.1))
    position, _, _ = press(platform, start, lambda boats: np.zeros(GAMES), Surroundings(field=FIELD))
    inside_s = np.argmax(position[..., 1] <= FIELD[3], axis=0) * 0.1
    top = get_platform(platform).max_speed_mps
    assert (position[..., 1].min(axis=0) <= FIELD[3]).all()
    assert inside_s.max() < beyond_m / top + 25.0


@pytest.mark.parametrize(("platform", "beyond_m"), [("heron", 150.0), ("surveyor", 600.0), ("heron", 5000.0)])
def test_a_boat_far_beyond_the_field_heads_home(platform, beyond_m):
    start = begin(platform, (40.0, 120.0), (FIELD[3] + beyond_m, FIELD[3] + beyond_m + 0.1))[:4]
    around = Surroundings(field=FIELD)
    position, _, _ = press(platform, start, lambda boats: np.zeros(len(boats)), around, steps=450)
    assert (position[0, :, 1] - position[-1, :, 1]).min() > 50.0


CORNER = np.array([160.0, 0.0])

CORNER_GAMES = 96


def press_into_the_corner(platform, boats):
    """Positions (T+1, CORNER_GAMES, boats, 2) m of boats that steer for the corner at top speed."""
    side_m, gap_m = (20.0, 4.0) if platform == "heron" else (40.0, 15.0)
    state = scattered(np.random.default_rng(1), CORNER_GAMES, [platform] * boats, side_m, gap_m=gap_m, speed=(0.3, 1.0))
    state[..., :2] += (115.0, 15.0)
    top = get_platform(platform).max_speed_mps
    wanted = on_course(lambda _, state: bearing_deg(CORNER - state[..., :2]), top)
    around = Surroundings(field=FIELD)
    run = sail_games(ShieldConfig(), state, [platform] * boats, [0] * boats, wanted, 650, surroundings=around)
    return run.position, run.closest(np.ones(boats, bool))


@pytest.mark.parametrize(("platform", "boats"), [("heron", 2), ("heron", 3), ("surveyor", 3)])
def test_boats_that_press_into_one_corner(platform, boats):
    """Where nothing but a turn towards a mate is left they give way beyond the edge, in few games and not far."""
    position, closest_m = press_into_the_corner(platform, boats)
    assert closest_m.min() >= 2.5
    inside_m = np.minimum(position - FIELD[:2], np.array(FIELD[2:]) - position).min(axis=(0, 2, 3))
    assert (inside_m < (-1.0 if platform == "heron" else -1.5)).mean() <= 0.04
    assert inside_m.min() >= -2.0
    assert (inside_m < 0.0).mean() <= (0.03 if platform == "heron" else 0.1)
    reached_m = np.linalg.norm(position - CORNER, axis=-1).min(axis=(0, 2))
    assert reached_m.max() < 5.0, "in some game nobody came to the corner"


@pytest.mark.parametrize(
    ("platform", "boats", "side_m", "gap_m"), [("heron", 6, 40.0, 6.0), ("surveyor", 4, 60.0, 12.0)]
)
def test_boats_that_wander_about_a_small_field(platform, boats, side_m, gap_m):
    random = np.random.default_rng(12)
    state = scattered(random, 20, [platform] * boats, side_m - 12.0, gap_m=gap_m, speed=(0.0, 0.5))
    state[..., :2] += 6.0
    wanted = Wander(12, 20, [platform] * boats, hold_s=4.0)
    around = Surroundings(field=(0.0, 0.0, side_m, side_m))
    run = sail_games(ShieldConfig(), state, [platform] * boats, [0] * boats, wanted, 500, surroundings=around)
    assert run.closest(np.ones(boats, bool)).min() >= 2.5
    inside_m = np.minimum(run.position, side_m - run.position).min(axis=(0, 2, 3))
    assert (inside_m >= 0.0).mean() >= 0.95
    assert inside_m.min() >= -0.5
    assert (run.reason > 0).mean() < 0.25
