"""A boat that an opponent keeps from turning does not sail on beside it for good; one pursued gains speed."""

import numpy as np
import pytest
from shield_loops import fill, packed, sail, step_all
from shield_scenes import fleet_of
from steerclear.experiments.encounters import Conditions, draw, play
from steerclear.shield import Commands, Fleet, Reason, Shield, Surroundings
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

GOAL_M = {"heron": 30.0, "surveyor": 72.0}

STEPS = {"heron": 450, "surveyor": 600}

COMES = {"heron": (-13.5, 6.75, 60.0, 1.96), "surveyor": (-33.0, 27.7, 53.0, 2.45)}

"""Opponents that come from the left: east and north, m, heading, deg, speed, m/s."""


def crossing(platform):
    """A boat heading north, and an opponent that will be where their ways cross when it is."""
    return fleet_of([(0.0, 0.0, 0.0, get_platform(platform).max_speed_mps), COMES[platform]], [0, 1], platform)


def towards_goal(platform, opponent):
    """Commands: the boat makes for a place straight ahead, the opponent does what ``opponent(state)`` says."""
    top = get_platform(platform).max_speed_mps

    def wanted(step, state):
        east, north = -state[0, L.X], GOAL_M[platform] - state[0, L.Y]
        error = np.degrees(np.arctan2(east, north)) - state[0, L.HEADING]
        return np.array([(top, (error + 180.0) % 360.0 - 180.0), (COMES[platform][-1], opponent(state))])

    return wanted


def arrives(run, platform):
    return np.hypot(run.position[:, 0, 0], run.position[:, 0, 1] - GOAL_M[platform]).min() < 3.0


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_a_boat_turned_aside_by_one_that_holds_its_course_gets_past_it(platform):
    """Turned aside as little as may be in each step it sailed on ahead of the other's bow for good."""
    run = sail(Shield(), crossing(platform), towards_goal(platform, lambda _: 0.0), STEPS[platform])
    assert arrives(run, platform)
    assert run.closest(np.array([True, False])) >= 2.5
    assert 0.0 < (run.reason[:, 0] != Reason.PASSED).mean() < 0.35


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_no_boat_gives_way_to_an_opponent(platform):
    """Turning away from a pursuer alongside would only cost speed."""

    def pursuit(state):
        way = state[0, :2] - state[1, :2]
        error = np.degrees(np.arctan2(*way)) - state[1, L.HEADING]
        return (error + 180.0) % 360.0 - 180.0

    run = sail(Shield(), crossing(platform), towards_goal(platform, pursuit), STEPS[platform])
    assert (run.reason[:, 0] == Reason.BACKUP).any()
    assert not (run.reason[:, 0] == Reason.RIGHT_OF_WAY).any()
    assert run.closest(np.array([True, False])) >= 2.5


def test_of_a_command_changed_for_an_edge_the_edge_is_told():
    """Also where the program or the eased backup found what keeps it, and a teammate is the nearest boat then."""
    field = Surroundings(field=(0.0, 0.0, 80.0, 40.0))
    fleet = fleet_of([(40.0, 34.0, 10.0, 2.0), (30.0, 10.0, 0.0, 0.0)], [0, 0], "heron")
    shield, state, told = Shield(), fleet.state.copy(), []
    fill(state, packed(fleet.platforms))
    for _ in range(120):
        now = Fleet(state, fleet.team, fleet.platforms, fleet.controlled, fleet.names)
        error = (10.0 - state[0, L.HEADING] + 180.0) % 360.0 - 180.0
        decisions = shield.decide(now, Commands.relative_deg([(2.0, error), (0.0, 0.0)]), field)
        found = decisions[0]
        told += [found.active_constraints] if found.intervened else []
        step_all(packed(fleet.platforms), state[None], decisions.filtered.values[None], 0.1)
    assert len(told) > 20
    assert set(told) == {("field",)}


def test_a_boat_that_is_handed_over_while_it_gives_way_holds_nobody_up():
    """Two press on each other; the one that gives way is then steered by hand, straight on."""
    shield = Shield()
    both = fleet_of([(0.0, 0.0, 0.0, 2.0), (2.7, 0.0, 0.0, 2.0)], [0, 0], "heron")
    state, given = both.state.copy(), None
    fill(state, packed(both.platforms))
    ruled = []
    for step in range(500):
        by_hand = given is not None
        controlled = np.array([not by_hand, True])
        now = Fleet(state, both.team, both.platforms, controlled, both.names)
        turns = np.array([0.0 if by_hand else 90.0, -90.0]) - state[:, L.HEADING]
        wanted = np.stack([np.full(2, 2.0), (turns + 180.0) % 360.0 - 180.0], axis=-1)
        decisions = shield.decide(now, Commands.relative_deg(wanted))
        if given is None and decisions.reason[0] == Reason.RIGHT_OF_WAY:
            given = step
        if by_hand:
            ruled.append(decisions.reason[1])
        step_all(packed(both.platforms), state[None], decisions.filtered.values[None], 0.1)
        gap = np.hypot(*(state[0, :2] - state[1, :2]))
        assert gap >= 2.5
    assert given is not None
    assert (np.array(ruled) != Reason.PASSED).mean() < 0.5
    assert state[1, L.X] < state[0, L.X] - 2.5, "it got to the side where it wanted"


def test_an_opponent_that_is_overtaken_is_passed():
    """The boat passes a slower one alongside, and its goal is ahead of that."""
    fleet = fleet_of([(0.0, 0.0, 0.0, 2.0), (1.0, 15.0, 0.0, 0.8)], [0, 1], "heron")

    def wanted(step, state):
        error = np.degrees(np.arctan2(-state[0, L.X], 60.0 - state[0, L.Y])) - state[0, L.HEADING]
        return np.array([(2.0, (error + 180.0) % 360.0 - 180.0), (0.8, 0.0)])

    run = sail(Shield(), fleet, wanted, 350)
    assert (run.reason[:, 0] == Reason.BACKUP).any()
    assert run.closest(np.array([True, False])) >= 2.5
    assert run.position[:, 0, 1].max() > 57.0


@pytest.mark.parametrize("number", [51, 81, 99, 125, 177, 223, 256, 296])
def test_boats_at_rest_that_can_get_away_do(number):
    """Encounters that ended with a hit as long as single wanted turns were sent that looked a little better."""
    conditions = Conditions()
    film = play(draw("at_rest", "surveyor", "surveyor", conditions, 0, number, 1), "shield:profile=ramming", conditions)
    assert film.safety_margin_m[0, 0, 0] > 0.3
    own, other = film.state[:, 0, 0, :2], film.state[:, 0, 1, :2]
    assert np.linalg.norm(own - other, axis=-1).min() >= 2.5
