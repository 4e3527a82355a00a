"""Behind every command is a plan of the whole team that is verified against itself, whatever stops or turns."""

import numpy as np
import pytest
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.barriers.boats import clear_of_boat
from steerclear.shield.barriers.clearance import FAR, MARGIN
from steerclear.shield.decision import Reason
from steerclear.shield.model import boats_of, tuning_of
from steerclear.shield.platforms import get_platform


def fleet_of(boats, **settings):
    """Boats (x, y, heading deg, speed) of one team, all decided for."""
    east, north, heading, speed = np.array(boats, float).T
    settings = {"platforms": "heron"} | settings
    return Fleet.of(
        position_m=np.column_stack([east, north]),
        heading_deg=heading,
        speed_mps=speed,
        team=[0] * len(boats),
        **settings,
    )


def margins(shield, i, j):
    """Clearance of boat i's planned path from boat j's, m: by the shield, and by the paths themselves."""
    scene = shield._deciders.scene
    clear_of_boat(i, j, scene.path[i], scene, -FAR, FAR)
    last = int(scene.boats.longest_samples)
    legs = scene.path[i, : last + 1] - scene.path[j, : last + 1]
    shares = np.linspace(0.0, 1.0, 51)[:, None, None]
    apart = np.hypot(*np.moveaxis(legs[:-1] + shares * (legs[1:] - legs[:-1]), -1, 0)).min()
    return scene.out[MARGIN], apart - scene.radius[i, j]


@pytest.mark.parametrize("seed", range(40))
def test_unlike_teammates_are_compared_for_the_longer_of_their_horizons(seed):
    random = np.random.default_rng(seed)
    place, heading = random.uniform(-16.0, 16.0, 2), random.uniform(-180.0, 180.0)
    boats = [(0.0, 0.0, 0.0, 2.0), (*place + np.sign(place) * 4.0, heading, random.uniform(0.5, 2.0))]
    fleet = fleet_of(boats, platforms=["surveyor", "heron"], names=["a", "b"])
    shield = Shield(profile="constant_velocity")
    shield.decide(fleet, Commands.absolute_deg([[2.0, 180.0], [boats[1][3], heading]]))
    scene = shield._deciders.scene
    assert scene.boats.samples[0] > scene.boats.samples[1]
    if scene.neighbours[0, 1]:
        found, by_paths = margins(shield, 0, 1)
        assert found <= by_paths + 1e-3


def test_a_stop_that_is_found_last_is_part_of_the_joint_plan():
    wall = ((-4.385, -60.0), (4.385, -60.0), (4.385, 0.0), (-4.385, 0.0))
    fleet = fleet_of([(-0.22, -5.49, 28.2, 0.67), (-0.68, -9.93, 0.6, 2.0)])
    shield = Shield(beyond_then="stop")
    decisions = shield.decide(fleet, Commands.absolute_deg([[2.0, 0.0]] * 2), Surroundings(polygons=[wall]))
    assert_verified(shield, decisions)


@pytest.mark.parametrize("seed", range(30))
def test_beside_walls_every_boat_is_verified_against_what_the_others_really_do(seed):
    random = np.random.default_rng(seed)
    width, first = random.uniform(3.0, 9.0), random.uniform(1.5, 7.0)
    wall = ((-width / 2, -60.0), (width / 2, -60.0), (width / 2, 0.0), (-width / 2, 0.0))
    boats = [
        (random.uniform(-0.5, 0.5), -first, random.uniform(-30.0, 30.0), random.uniform(0.5, 2.0)),
        (random.uniform(-1.0, 1.0), -first - random.uniform(2.6, 6.0), random.uniform(-20.0, 20.0), 2.0),
    ]
    shield = Shield(beyond_then="stop")
    decisions = shield.decide(fleet_of(boats), Commands.absolute_deg([[2.0, 0.0]] * 2), Surroundings(polygons=[wall]))
    assert_verified(shield, decisions)


def assert_verified(shield, decisions):
    """No boat that claims a verified plan comes nearer to another's than it says."""
    for i, decision in enumerate(decisions):
        if decision.reason not in (Reason.BEST_EFFORT, Reason.STOPPED):
            for j in range(len(decisions)):
                if j != i and shield._deciders.scene.neighbours[i, j]:
                    assert margins(shield, i, j)[0] >= min(0.0, decision.safety_margin_m) - 1e-6


@pytest.mark.parametrize("seed", range(20))
def test_a_boat_that_is_stopped_is_part_of_no_least_change(seed):
    random = np.random.default_rng(seed)
    second = (random.uniform(-6.0, 6.0), random.uniform(-1.0, 4.5), random.uniform(-180.0, 180.0), 2.0)
    fleet = fleet_of([(0.0, 5.5, 0.0, random.uniform(0.0, 1.0)), second])
    shield = Shield(edge_m=None, beyond_m=5.0, beyond_then="stop")
    course = random.uniform(-180.0, 180.0)
    water = Surroundings(field=(-50.0, -50.0, 50.0, 0.0))
    decisions = shield.decide(fleet, Commands.absolute_deg([[2.0, 0.0], [2.0, course]]), water)
    stopped = decisions[0]
    assert (stopped.reason, stopped.filtered_speed_mps, stopped.solver) == (Reason.STOPPED, 0.0, None)
    assert_verified(shield, decisions)


def test_errors_of_others_grow_over_the_delay_that_is_counted():
    config = ShieldConfig(dt_s=1.0, delay_s=1.01, move_s=0.1)
    assert tuning_of(config).delay_s == 2.0


def test_paths_of_one_kind_of_boat_are_as_long_as_before():
    boats = boats_of(ShieldConfig(), ("heron",) * 6, (0, 0, 0, 1, 1, 1))
    assert boats.longest_samples == boats.samples.max() == boats.samples.min()


def lying_near(random, boats):
    """Places of boats, m, no two nearer than 2.56 m, that all could lie still, and their headings, deg."""
    while True:
        place = random.uniform(-2.2, 2.2, (boats, 2)) * np.sqrt(boats / 2.0)
        apart = np.hypot(*(place[:, None] - place[None]).transpose(2, 0, 1)) + 9.0 * np.eye(boats)
        if apart.min() > 2.56:
            return place, random.uniform(-180.0, 180.0, boats), apart.min()


@pytest.mark.parametrize("platform", ["si", "di", "heron", "surveyor"])
@pytest.mark.parametrize("boats", [3, 4])
def test_boats_at_rest_that_are_all_sent_to_the_middle_find_a_plan_at_once(boats, platform):
    """Two of them may find no way out but one that a third, whose command passed, could leave open; or all stop."""
    random, top = np.random.default_rng(boats), get_platform(platform).max_speed_mps
    for _ in range(100):
        place, heading, apart = lying_near(random, boats)
        to_middle = np.degrees(np.arctan2(*(place.mean(axis=0) - place).T))
        rows = [(*place[i], heading[i], 0.0) for i in range(boats)]
        nominal = Commands.absolute_deg(np.stack([np.full(boats, top), to_middle], axis=1))
        decisions = Shield().decide(fleet_of(rows, platforms=platform), nominal)
        assert not (decisions.reason == Reason.BEST_EFFORT).any(), (place, heading)
        assert decisions.safety_margin_m.min() >= min(0.0, apart - 2.55) - 1e-3


def test_boats_that_the_last_line_stops_are_predicted_to_stop_as_they_lie():
    """Whatever the others are tried with meanwhile: none of them is taken to turn."""
    stopped = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        boats, width = int(random.integers(3, 6)), random.uniform(3.0, 8.0)
        wall = ((-width / 2, -60.0), (width / 2, -60.0), (width / 2, 0.0), (-width / 2, 0.0))
        place = random.uniform([-width / 2 - 2.0, -4.0], [width / 2 + 2.0, 4.0], (boats, 2))
        rows = np.column_stack([place, random.uniform(-180.0, 180.0, boats), random.uniform(0.0, 2.0, boats)])
        nominal = Commands.absolute_deg(np.column_stack([np.full(boats, 2.0), random.uniform(-180.0, 180.0, boats)]))
        shield = Shield(beyond_then="stop", beyond_m=3.0)
        decisions = shield.decide(fleet_of(rows), nominal, Surroundings(polygons=[wall]))
        stops = decisions.reason == Reason.STOPPED
        stopped += stops.sum()
        assert np.isnan(shield._deciders.scene.held[stops, 1]).all(), "no heading to turn to"
    assert stopped > 100
