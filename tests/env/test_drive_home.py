import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.drive_home import heading_into_field, heading_past_obstacles
from steerclear.env.mctf import MctfEnv
from steerclear.env.obstacles import pack_obstacles
from steerclear.shield.platforms import layout as L

SIZE = np.array([80.0, 40.0])


def obstacles(**kinds):
    return pack_obstacles(GameConfig(obstacles=kinds).obstacles)


@pytest.mark.parametrize(
    ("place_m", "heading"),
    [((30, -1), 0), ((81, 20), -90), ((30, 41), 180), ((-1, 20), 90), ((30, 1), 0), ((-3, -1), 0), ((-1, -3), 0)],
)
def test_out_of_bounds_the_way_back_is_perpendicular_to_the_nearest_edge(place_m, heading):
    assert heading_into_field(SIZE, *map(float, place_m)) == heading


def test_a_tagged_boat_is_driven_home_at_full_speed(place):
    core = place({0: (50.0, 30.0)}, is_tagged={"agent_0": True}, heading={"agent_0": 0.0}, platforms="heron")
    wanted = np.full((1, 4, 2), 0.5)
    commands = core.commands(wanted)
    assert core.driven[0].tolist() == [True, False, False, False]
    np.testing.assert_allclose(commands[0, 0], (2.0, np.degrees(np.arctan2(-40.0, -10.0))))
    np.testing.assert_array_equal(commands[0, 1:], wanted[0, 1:])


def test_out_of_bounds_at_half_speed_tagged_or_not(place):
    core = place({0: (30.0, 30.0)}, heading={"agent_0": 0.0}, platforms="heron")
    core.oob[0, 0] = True
    core.state[0, 0, L.Y] = 41.0
    wanted = np.zeros((1, 4, 2))
    np.testing.assert_allclose(core.commands(wanted)[0, 0], (1.0, 180.0))
    core.is_tagged[0, 0] = True
    speed, heading = core.commands(wanted)[0, 0]
    assert speed == 1.0
    assert heading == pytest.approx(np.degrees(np.arctan2(-20.0, -21.0)))


def test_the_way_past_obstacles_is_straight_unless_one_is_in_it():
    goal = np.array([10.0, 20.0])
    block = obstacles(circle=[(3.0, (40.0, 20.0))])
    assert heading_past_obstacles(block, 1.25, 70.0, 20.0, goal) % 360.0 != 270.0
    aside = np.degrees(np.arcsin(5.25 / 30.0))
    assert abs(abs(heading_past_obstacles(block, 1.25, 70.0, 20.0, goal) + 90.0) - aside) < 1e-9
    for free in (obstacles(circle=[(3.0, (40.0, 30.0))]), obstacles(circle=[(3.0, (75.0, 20.0))]), obstacles()):
        assert heading_past_obstacles(free, 1.25, 70.0, 20.0, goal) == -90.0


def test_a_polygon_is_passed_on_its_shorter_side():
    wall = obstacles(polygon=[((39.0, 5.0), (41.0, 5.0), (41.0, 24.0), (39.0, 24.0))])
    heading = heading_past_obstacles(wall, 1.25, 70.0, 20.0, np.array([10.0, 20.0]))
    assert -90.0 < heading < -60.0, "north about, where the end is nearer"
    assert heading_past_obstacles(wall, 1.25, 70.0, 30.0, np.array([10.0, 30.0])) == -90.0


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
