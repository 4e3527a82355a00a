"""Teammates that keep each other from turning: one gives way, and both get where they want."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import fill, on_course, packed, sail, sail_games, step_all
from shield_scenes import fleet_of
from steerclear.shield import Commands, Reason, Shield, ShieldConfig
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

LOG = logging.getLogger(__name__)
ARRIVED_M = 4.0


def to_the_other_side(platform, angle, radius_m, steps, **settings):
    """Boats from rest on a circle at ``angle`` (games, boats) rad, each wanting to go to the other side and back.

    Returns:
        Steps at which each boat arrived at either end (games, boats, 2), infinite where it did not, and the run.
    """
    games, boats = angle.shape
    start = radius_m * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    state = np.zeros((games, boats, L.N_STATE))
    state[..., : L.Y + 1], state[..., L.HEADING], state[..., L.THRUST] = start, np.degrees(angle) - 180.0, np.nan
    for game in state:
        fill(game, packed([platform] * boats))
    at, top = np.full((games, boats, 2), np.inf), get_platform(platform).max_speed_mps

    def wanted(step, now):
        back = np.isfinite(at[..., :1])
        way = np.where(back, start, -start) - now[..., : L.Y + 1]
        near = np.hypot(way[..., 0], way[..., 1]) < ARRIVED_M
        at[..., 1][near & back[..., 0] & np.isinf(at[..., 1])] = step
        at[..., 0][near & ~back[..., 0]] = step
        error = np.degrees(np.arctan2(way[..., 0], way[..., 1])) - now[..., L.HEADING]
        return np.stack([np.full(error.shape, top), (error + 180.0) % 360.0 - 180.0], axis=-1)

    run = sail_games(ShieldConfig(**settings), state, [platform] * boats, [0] * boats, wanted, steps)
    return at, run


def on_a_circle(boats, turned_rad):
    """Angles (games, boats) rad of boats all round a circle."""
    return 2.0 * np.pi * np.arange(boats) / boats + np.atleast_2d(turned_rad).T


def test_boats_that_cross_in_the_middle_all_arrive():
    random = np.random.default_rng(0)
    angle = on_a_circle(3, random.uniform(0.0, 6.0, 6)) + random.normal(size=(6, 3)) / 80.0
    never, _ = to_the_other_side("surveyor", angle, 80.0, 1200, deadlock_timeout_s=np.inf)
    assert np.isinf(never[..., 0]).any(), "without right of way two sail on side by side: or this test shows nothing"
    at, run = to_the_other_side("surveyor", angle, 80.0, 1200)
    assert at[..., 0].max() < 1150
    assert run.closest(np.ones(3, bool)).min() >= 2.5
    assert (run.reason == Reason.RIGHT_OF_WAY).any()


@pytest.mark.parametrize("boats", [3, 6])
def test_boats_that_stop_at_once_go_round_each_other(boats):
    angle = on_a_circle(boats, np.zeros(6)) + np.random.default_rng(0).uniform(-0.17, 0.17, (6, boats))
    never, _ = to_the_other_side("si", angle, 40.0, 300, deadlock_timeout_s=np.inf)
    assert np.isinf(never[..., 0]).any(), "without right of way some stand before each other: or this shows nothing"
    at, run = to_the_other_side("si", angle, 40.0, 600)
    assert at[..., 0].max() < 550
    assert run.closest(np.ones(boats, bool)).min() >= 2.5
    assert (run.reason == Reason.RIGHT_OF_WAY).any()


@pytest.mark.study
@pytest.mark.parametrize("boats", [3, 4, 12])
@pytest.mark.parametrize(("platform", "radius_m"), [("heron", 30.0), ("surveyor", 80.0)])
def test_how_many_cross_and_come_back(platform, radius_m, boats):
    """Of 20 games from places that are 1 m off at random, 240 s long."""
    random = np.random.default_rng(0)
    angle = on_a_circle(boats, random.uniform(0.0, 6.0, 20)) + random.normal(size=(20, boats)) / radius_m
    stuck = []
    for after_s in (np.inf, ShieldConfig().deadlock_timeout_s):
        at, run = to_the_other_side(platform, angle, radius_m, 2400, deadlock_timeout_s=after_s)
        lost = int(np.isinf(at[..., 0]).sum())
        stuck.append(lost)
        LOG.warning(
            "%d %s, right of way after %s s: %d of %d never across, the last after %.0f s, %d never back, least %.2f m",
            *(boats, platform, after_s, lost, at[..., 0].size, 0.1 * at[..., 0].max()),
            *(int(np.isinf(at[..., 1]).sum()), run.closest(np.ones(boats, bool)).min()),
        )
        assert run.closest(np.ones(boats, bool)).min() >= 2.5
    assert stuck[1] == 0


def abreast(platform="heron", starboard_m=2.7, ahead_m=0.0):
    """Two boats of ours heading north, the second to starboard of the first and so much ahead."""
    top = get_platform(platform).max_speed_mps
    return fleet_of([(0.0, 0.0, 0.0, top), (starboard_m, ahead_m, 0.0, top)], [0, 0], platform)


def press_together(fleet, steps, turns=(90.0, -90.0), **settings):
    top = get_platform(fleet.platforms[0]).max_speed_mps
    return sail(Shield(ShieldConfig(**settings)), fleet, on_course(turns, top), steps)


def roles(run):
    """(T, n) whether each boat gives way, and whether it stands on."""
    ruled = run.reason == Reason.RIGHT_OF_WAY
    return ruled & (run.sent[..., 1] != 0.0), ruled & (run.sent[..., 1] == 0.0)


@pytest.mark.parametrize(
    ("starboard_m", "ahead_m", "who"),
    [(2.7, 0.0, 0), (-2.7, 0.0, 1), (2.7, -1.6, 1), (-2.7, -1.6, 1), (-2.7, 1.6, 0)],
)
def test_who_is_behind_or_has_the_other_to_starboard_gives_way(starboard_m, ahead_m, who):
    sides = (90.0, -90.0) if starboard_m > 0 else (-90.0, 90.0)
    run = press_together(abreast("heron", starboard_m, ahead_m), 120, sides)
    gives_way, _ = roles(run)
    first = np.flatnonzero(gives_way.any(axis=1))[0]
    assert 25 <= first <= 60
    assert gives_way[first].tolist() == [who == 0, who == 1]
    assert np.sign(run.sent[first, who, 1]) == -np.sign(sides[who]), "away from the other"
    assert run.closest(np.ones(2, bool)) >= 2.5
    way_m = run.position[-1, :, 0] - run.position[0, :, 0]
    assert (way_m * np.sign(sides) > 2.5).all(), "both get to where they want"


def test_the_decision_names_the_other():
    fleet, shield, found = abreast(), Shield(), []

    def wanted(step, state):
        return np.stack([np.full(2, 2.0), np.array([90.0, -90.0]) - state[:, L.HEADING]], axis=-1)

    decide = shield.decide

    def listen(*args):
        found.append(decide(*args))
        return found[-1]

    shield.decide = listen
    sail(shield, fleet, wanted, 60)
    said = [decision for decisions in found for decision in decisions if decision.reason is Reason.RIGHT_OF_WAY]
    assert said
    assert all({decision.boat, *decision.active_constraints} == {*fleet.names} for decision in said)
    assert all(decision.intervened and decision.safety_margin_m >= 0.0 for decision in said)


@pytest.mark.parametrize(("thrust", "starboard_m"), [(20.0, 3.6), (100.0, 4.3), (100.0, 3.0)])
def test_a_boat_that_turns_slowly_but_turns_is_left_alone(thrust, starboard_m):
    """Its turn was changed once, by a teammate that then made room: from then on what it wants passes."""
    fleet = abreast("surveyor", starboard_m=starboard_m)
    state = fleet.state.copy()
    state[:, L.THRUST], state[:, L.SPEED] = thrust, 3.0
    fleet = replace(fleet, state=state)

    def wanted(step, now):
        error = np.array([60.0, 60.0 if step > 5 else -60.0]) - now[:, L.HEADING]
        return np.stack([np.full(2, 3.0), error], axis=-1)

    run = sail(Shield(), fleet, wanted, 150)
    changed = (run.reason >= Reason.LEAST_CHANGE) & (run.reason <= Reason.BEST_EFFORT)
    assert changed[:, 0].any(), "or nothing began that could have gone on"
    assert not (run.reason == Reason.RIGHT_OF_WAY).any()


def test_boats_that_come_and_go_far_away_change_nothing_about_who_gives_way():
    near = abreast()
    far = fleet_of([(0, 0, 0, 2), (2.7, 0, 0, 2), (400, 400, 0, 2)], [0, 0, 1], names=[*near.names, "far"])
    runs = []
    for others in (False, True):
        shield, state, reasons = Shield(), near.state.copy(), []
        fill(state, packed(near.platforms))
        for step in range(120):
            turns = np.array([90.0, -90.0]) - state[:, L.HEADING]
            commands = np.stack([np.full(2, 2.0), (turns + 180.0) % 360.0 - 180.0], axis=-1)
            fleet = replace(near, state=state.copy())
            if others and step % 2:
                fleet = replace(far, state=np.concatenate([state, far.state[2:]]))
                commands = np.concatenate([commands, [[2.0, 0.0]]])
            decisions = shield.decide(fleet, Commands.relative_deg(commands))
            step_all(packed(near.platforms), state[None], decisions.filtered.values[None, :2], 0.1)
            reasons.append(decisions.reason[:2].copy())
        runs.append((np.array(reasons), state))
    assert (runs[0][0] == Reason.RIGHT_OF_WAY).any()
    np.testing.assert_array_equal(runs[0][0], runs[1][0])
    np.testing.assert_array_equal(runs[0][1], runs[1][1])


def test_three_abreast_that_press_inwards_all_get_where_they_want():
    top = get_platform("heron").max_speed_mps
    fleet = fleet_of([(0, 0, 0, top), (2.8, 0, 0, top), (5.6, 0, 0, top)], [0, 0, 0], "heron")
    run = sail(Shield(), fleet, on_course([90.0, 0.0, -90.0], top), 300)
    assert run.closest(np.ones(3, bool)) >= 2.5
    assert run.position[-1, 0, 0] > run.position[-1, 2, 0] + 10.0


@pytest.mark.parametrize("coordination", ["team", "per_boat"])
def test_boats_that_cannot_talk_agree_on_who_gives_way(coordination):
    gives_way, stands_on = roles(press_together(abreast(), 120, coordination=coordination))
    assert gives_way[:, 0].any()
    assert not gives_way[:, 1].any()
    assert not stands_on[:, 0].any()
    assert stands_on[:, 1].any() == (coordination == "per_boat"), "told of the other's turn, nothing is in its way"


def test_boats_that_stand_before_each_other_and_cannot_talk_go_round_each_other():
    fleet = fleet_of([(0.0, 0.0, 0.0, 0.0), (0.0, 3.4, 180.0, 0.0), (3.0, 1.7, -90.0, 0.0)], [0, 0, 0], "si")
    goal_m = np.array([(0.0, 40.0), (0.0, -40.0), (-40.0, 1.7)])
    nearest_m = np.full(3, np.inf)

    def wanted(step, state):
        way = goal_m - state[:, : L.Y + 1]
        np.minimum(nearest_m, np.hypot(*way.T), out=nearest_m)
        error = np.degrees(np.arctan2(way[:, 0], way[:, 1])) - state[:, L.HEADING]
        return np.stack([np.full(3, 10.0), (error + 180.0) % 360.0 - 180.0], axis=-1)

    run = sail(Shield(ShieldConfig(coordination="per_boat")), fleet, wanted, 600)
    assert (nearest_m < ARRIVED_M).all()
    assert run.closest(np.ones(3, bool)) >= 2.5


@pytest.mark.parametrize("platform", ["heron", "heron_v22"])
def test_a_boat_that_needs_way_is_not_told_to_turn_where_it_lies(platform):
    """It would lie still for 20 s at a time, and be said to give way."""
    fleet = fleet_of([(0.0, 0.0, 0.0, 0.0), (0.0, 2.6, 180.0, 0.0)], [0, 0], platform)
    run = sail(Shield(), fleet, on_course([0.0, 180.0], 2.0), 150)
    assert (run.sent[..., 0][run.reason == Reason.RIGHT_OF_WAY] > 0.0).all()
    assert run.closest(np.ones(2, bool)) >= 2.5
