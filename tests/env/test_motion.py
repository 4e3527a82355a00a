"""How the game moves boats: off obstacles and the own flag, home when tagged or out of bounds."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.drive_home import heading_into_field, heading_past_obstacles
from steerclear.env.mctf import MctfEnv
from steerclear.env.motion import entry_point
from steerclear.env.obstacles import pack_obstacles
from steerclear.shield.platforms import layout as L

CIRCLE = {"circle": [(3.0, (40.0, 20.0))]}


def test_a_boat_that_hits_an_obstacle_goes_back_turned_round_and_stopped(place):
    core = place({0: (35.5, 20.0), 2: (75.0, 5.0)}, overrides={"obstacles": CIRCLE}, heading={"agent_0": 90.0})
    actions = np.zeros((1, 4, 2))
    actions[0, 0] = 10.0, 0.0
    core.step(actions)
    into = core.state[0, 0, :2].copy()
    assert into[0] > 35.9
    core.state[0, 0, L.THRUST] = 50.0
    core.step(actions)
    np.testing.assert_allclose(core.state[0, 0, [L.X, L.Y]], (35.5, 20.0))
    assert core.state[0, 0, L.HEADING] == -90.0
    assert core.state[0, 0, [L.SPEED, L.THRUST, L.RUDDER]].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_array_equal(core.previous_position[0, 0], into)
    assert core.driven[0, 0]
    assert not core.is_tagged.any()


def test_an_obstacle_costs_the_flag_and_tags_where_the_rules_say_so(place):
    wedge = {"polygon": [((40.0, 18.0), (44.9, 20.0), (40.0, 22.0))]}
    core = place(
        {0: (47.0, 20.0), 1: (5.0, 5.0)},
        overrides={"obstacles": wedge, "tag_on_collision": True},
        has_flag={"agent_0": True},
        heading={"agent_0": -90.0},
    )
    actions = np.zeros((1, 4, 2))
    actions[0, 0] = 10.0, 0.0
    for _ in range(3):
        core.step(actions)
    assert core.is_tagged[0, 0]
    assert not core.has_flag.any()
    assert not core.flag_taken.any()


CENTRE = np.array([10.0, 20.0])

RADIUS = 4.25

examples = settings(derandomize=True, deadline=None, max_examples=200)


@examples
@given(st.floats(0.1, 4.0), st.floats(-180.0, 180.0), st.floats(0.05, 1.0), st.floats(-180.0, 180.0))
def test_the_entry_point_lies_on_the_circle_ahead_on_the_ray(depth, angle, length, course):
    inside = CENTRE + depth * np.array([math.sin(math.radians(angle)), math.cos(math.radians(angle))])
    before = inside + length * np.array([math.sin(math.radians(course)), math.cos(math.radians(course))])
    assume(abs(before[0] - inside[0]) > 1e-3)
    place = np.array(entry_point(inside, before, CENTRE, RADIUS))
    assert abs(np.linalg.norm(place - CENTRE) - RADIUS) < 1e-6
    ray, way = before - inside, place - inside
    assert abs(ray[0] * way[1] - ray[1] * way[0]) < 1e-6
    assert ray @ way > 0.0


def test_rays_along_the_axes_and_no_ray_at_all():
    inside = np.array([11.0, 20.0])
    np.testing.assert_allclose(entry_point(inside, np.array([12.0, 20.0]), CENTRE, 5.0), (15.0, 20.0))
    np.testing.assert_allclose(entry_point(inside, np.array([9.0, 20.0]), CENTRE, 5.0), (5.0, 20.0))
    np.testing.assert_allclose(entry_point(np.array([13.0, 20.0]), np.array([13.0, 25.0]), CENTRE, 5.0), (13.0, 24.0))
    np.testing.assert_allclose(entry_point(inside, inside, CENTRE, 5.0), (15.0, 20.0))
    assert np.isfinite(entry_point(CENTRE, CENTRE, CENTRE, 5.0)).all()


SIZE = np.array([80.0, 40.0])


def obstacles(**kinds):
    return pack_obstacles(GameConfig(obstacles=kinds).obstacles)


@pytest.mark.parametrize(
    ("place_m", "heading"),
    [((30, -1), 0), ((81, 20), -90), ((30, 41), 180), ((-1, 20), 90), ((30, 1), 0), ((-3, -1), 0), ((-1, -3), 0)],
)
def test_out_of_bounds_the_way_back_is_perpendicular_to_the_nearest_edge(place_m, heading):
    assert heading_into_field(SIZE, *map(float, place_m)) == heading


def test_the_way_past_obstacles_is_straight_unless_one_is_in_it():
    goal = np.array([10.0, 20.0])
    block = obstacles(circle=[(3.0, (40.0, 20.0))])
    assert heading_past_obstacles(block, 1.25, 70.0, 20.0, goal) % 360.0 != 270.0
    aside = np.degrees(np.arcsin(5.25 / 30.0))
    assert abs(abs(heading_past_obstacles(block, 1.25, 70.0, 20.0, goal) + 90.0) - aside) < 1e-9
    for free in (obstacles(circle=[(3.0, (40.0, 30.0))]), obstacles(circle=[(3.0, (75.0, 20.0))]), obstacles()):
        assert heading_past_obstacles(free, 1.25, 70.0, 20.0, goal) == -90.0


@pytest.mark.parametrize(
    "shapes",
    [
        {"circle": [(5.0, (40.0, 20.0))]},
        {"polygon": [((35.0, 8.0), (38.0, 8.0), (38.0, 32.0), (35.0, 32.0))]},
        {"polygon": [((30.0, 10.0), (50.0, 10.0), (40.0, 30.0))], "circle": [(2.0, (25.0, 20.0))]},
    ],
)
def test_tagged_boats_get_home_past_obstacles(shapes):
    env = MctfEnv(GameConfig.preset("aamas2024", obstacles=shapes))
    for y in (6.0, 20.0, 34.0):
        start = {"agent_position": {"agent_0": (60.0, y)}, "agent_is_tagged": {"agent_0": True}}
        env.reset(options={"init_dict": start})
        for _ in range(600):
            env.step({})
            if not env.core.is_tagged[0, 0]:
                break
        assert not env.core.is_tagged[0, 0]
