"""Boats whose thrust is not full: run through until it is, then looked up."""

import math
from dataclasses import replace

import numpy as np
import pytest
from shield_loops import step_all
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.pursuit import clear_of_pursuer
from steerclear.shield.batch import BatchedShield
from steerclear.shield.model import boats_of
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import limits_of
from steerclear.shield.platforms.usv import fresh_state

SURVEYOR = get_platform("surveyor")


def slow_boat(speed_mps=1.0, thrust=20.0):
    row = fresh_state(0.0, 0.0, 0.0, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = thrust, 0.0, 0.0
    return row


def opponent(x, y, heading_deg):
    row = fresh_state(x, y, heading_deg, 3.0)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = 100.0, 0.0, 0.0
    return row


def nimble(thrust, speed_mps, *others):
    """A heron with that thrust and others about it, and what is looked at of it."""
    row = fresh_state(0.0, 0.0, 0.0, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = thrust, 2.0 - speed_mps, 0.0
    rows = np.array([row, *others])
    at = stages_of(
        ShieldConfig(profile="ramming", margin_cap_m=50.0), rows, ["heron"] * len(rows), [0] + [1] * (len(rows) - 1)
    )
    find_neighbours(at.scene)
    return at


def test_who_comes_near_only_while_thrust_is_built_up_is_seen_coming():
    """Straight on from rest against a boat 11.5 m astern at 2 m/s: still 5 m away after 6 s, 2 m after 19 s."""
    for thrust, speed_mps, fails in [(0.0, 0.0, True), (100.0, 2.0, False)]:
        at = nimble(thrust, speed_mps, fresh_state(0.0, -11.5, 0.0, 2.0))
        roll_out(0, 0, 1.0, 0.0, 2.0, 0, at.scene)
        assert (clear_of_pursuer(0, 1, 0, -1e6, at.scene) < 0.0) == fails


@pytest.mark.parametrize("wanted_mps", [2.0, 0.0])
def test_it_makes_no_difference_on_which_side_of_enough_the_thrust_is(wanted_mps):
    """Else margins would drop in the step in which a boat that slows down comes to have less."""
    random, drops = np.random.default_rng(5), []
    enough = stages_of(ShieldConfig(profile="ramming"), np.array([slow_boat()]), ["heron"], [0]).boats.ready_thrust[0]
    for _ in range(300):
        angle, far, heading = (
            random.uniform(-math.pi, math.pi),
            random.uniform(6.0, 40.0),
            random.uniform(-180.0, 180.0),
        )
        other = fresh_state(far * math.sin(angle), far * math.cos(angle), heading, random.uniform(0.5, 2.0))
        more, less = (
            safety_margin_m(nimble(thrust, 1.7, other).state, wanted_mps) for thrust in (enough + 0.1, enough - 0.1)
        )
        drops.append(abs(more - less))
    assert np.median(drops) < 0.06
    assert np.percentile(drops, 90) < 0.3


def safety_margin_m(state, wanted_mps):
    """What a batch of one game tells of its first boat."""
    shield = BatchedShield(ShieldConfig(profile="ramming"), 1, ("heron", "heron"), (0, 1))
    wanted = np.array([[[wanted_mps, 0.0], [2.0, 0.0]]])
    shield.decide(state[None].copy(), wanted, np.array([[True, False]]))
    return min(float(shield.safety_margin_m[0, 0]), 2.0)


def test_a_boat_that_is_always_slow_is_at_full_thrust_with_what_it_has():
    slow = replace(get_platform("heron"), name="slow_heron", max_speed_mps=1.7)
    steady = limits_of(slow).thrust
    assert 80.0 < steady < 85.0
    boats = boats_of(ShieldConfig(profile="ramming"), (slow, slow), (0, 1))
    assert boats.ready_thrust[0] == pytest.approx(0.85 * steady)


def chased(certificate, count=40, steps=500):
    """First certificates and closest distances of slow boats without thrust, each with a rammer that leads it."""
    rng, params = np.random.default_rng(8), SURVEYOR.pack()
    state = np.zeros((count, 2, L.N_STATE))
    for game in state:
        game[0] = slow_boat(rng.uniform(0.5, 2.0), 30.0)
        angle, far = rng.uniform(-math.pi, math.pi), rng.uniform(10.0, 60.0)
        game[1] = opponent(far * math.sin(angle), far * math.cos(angle), math.degrees(angle) + 180.0)
    shield = BatchedShield(
        ShieldConfig(profile="ramming", opponent_model=certificate), count, ("surveyor",) * 2, (0, 1)
    )
    ours, closest, first = np.tile([True, False], (count, 1)), np.full(count, math.inf), None
    for _ in range(steps):
        wanted = np.zeros((count, 2, 2))
        wanted[:, :, 0] = 3.0
        wanted[:, 1, 1] = bearing_to_quarry(state)
        sent = shield.decide(state, wanted, ours)
        first = shield.safety_margin_m[:, 0].copy() if first is None else first
        step_all(np.array([params, params]), state, sent, 0.1)
        closest = np.minimum(closest, np.linalg.norm(state[:, 0, :2] - state[:, 1, :2], axis=1))
    return first, closest


def bearing_to_quarry(state):
    """Turn, deg, of each rammer to where the boat will be when it gets there at 3 m/s."""
    heading = np.radians(state[:, 0, L.HEADING])
    way = state[:, 0, :2] - state[:, 1, :2]
    ahead_s = np.linalg.norm(way, axis=1) / 3.0
    way = way + (state[:, 0, L.SPEED] * ahead_s)[:, None] * np.column_stack([np.sin(heading), np.cos(heading)])
    return (np.degrees(np.arctan2(way[:, 0], way[:, 1])) - state[:, 1, L.HEADING] + 180.0) % 360.0 - 180.0


def test_who_is_promised_a_backup_gets_it():
    first, closest = chased("auto")
    assert (first >= 0.0).sum() > 10
    assert (closest[first >= 0.0] >= 2.5).all()


def test_more_are_promised_one_than_by_running_pursuers_through_for_minutes():
    first, _ = chased("auto", steps=1)
    minutes, _ = chased("turning_circle", steps=1)
    assert (first >= 0.0).sum() > (minutes >= 0.0).sum()
