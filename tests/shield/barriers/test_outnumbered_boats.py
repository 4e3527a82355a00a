"""Boats that several opponents can come near to: these are rolled out for a while before they are looked up."""

import math

import numpy as np
import pytest
from stages import decided, screened, stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.paths import READY_HEADING, READY_SAMPLE, READY_SPEED, sail
from steerclear.shield.backup.rollout import lay_path
from steerclear.shield.barriers.boats import worst_clearance
from steerclear.shield.barriers.clearance import FAR, MARGIN
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.pursuit import worst_pursuer
from steerclear.shield.barriers.value_function import margin_at_once, run_opponents, worst_at_once
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state
from steerclear.shield.workspace import JOINT_MARGIN, N_MEMORY

SECONDS = 3.0
"""Time over which they are rolled out."""


def boat(x, y, heading_deg, speed_mps=3.0):
    row = fresh_state(x, y, heading_deg, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = 100.0, 3.0 - speed_mps, 0.0
    return row


def looked_around(*rows):
    """The first boat is ours, all are surveyors."""
    teams = [0] + [1] * (len(rows) - 1)
    at = stages_of(ShieldConfig(profile="ramming"), np.array(rows), ["surveyor"] * len(rows), teams)
    find_neighbours(at.scene)
    return at


def rolled_out(at, side=1.0, turn_deg=90.0, speed_mps=3.0, done=0):
    at.next_state[0] = at.state[0]
    lay_path(0, 0, side, turn_deg, speed_mps, done, at.scene)


def around(random, count):
    """Opponents all about, on their way to a boat at the origin."""
    for angle in random.uniform(-math.pi, math.pi, count):
        far, heading = random.uniform(12.0, 30.0), math.degrees(angle) + random.uniform(130.0, 230.0)
        yield boat(far * math.sin(angle), far * math.cos(angle), heading, random.uniform(1.5, 3.0))


def rated(at):
    """Margins against the opponents on the path in the first boat's slot."""
    worst_clearance(0, 0, at.scene, -FAR)
    worst_pursuer(0, 0, -FAR, at.scene)
    return (*at.threats_m[0], at.joint_m[0], at.threat_m[0], at.fails[0], at.clear[0, MARGIN], at.bound[0])


def test_one_opponent_outnumbers_nobody_and_two_that_the_tables_tell_of_do():
    ahead, abeam, far = boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0), boat(0.0, -500.0, 180.0)
    for others, outnumbered in [((ahead,), False), ((ahead, far), False), ((ahead, abeam), True)]:
        assert looked_around(boat(0.0, 0.0, 0.0), *others).outnumbered[0] == outnumbered


@pytest.mark.parametrize("thrust", [100.0, 89.0, 30.0])
def test_a_boat_that_lacks_thrust_is_outnumbered_all_the_same(thrust):
    """Else it would be rated better for having slowed down: its opponents one by one, a moment later."""
    own = boat(0.0, 0.0, 0.0, 2.0)
    own[L.THRUST] = thrust
    assert looked_around(own, boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0)).outnumbered[0]


@pytest.mark.parametrize("done", [0, 1])
@pytest.mark.parametrize(("speed_mps", "side", "turn_deg"), [(3.0, -1.0, 90.0), (1.0, 1.0, 0.0), (1.0, 0.5, 120.0)])
def test_runs_end_after_some_seconds_where_the_full_model_is(done, speed_mps, side, turn_deg):
    at = looked_around(boat(0.0, 0.0, 0.0, speed_mps), boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0))
    rolled_out(at, side, turn_deg, done=done)
    k = int(at.ready[0, READY_SAMPLE])
    assert SECONDS <= k * at.boats.sample_s < SECONDS + at.boats.sample_s
    row, togo = at.state[0].copy(), turn_deg
    for _ in range(k * at.boats.stride + 1 - done):
        togo = sail(at.boats.params[0], row, side, togo, 3.0, at.tuning.dt_s)
    np.testing.assert_allclose(at.path[0, k], row[:2], atol=1e-3)
    assert at.ready[0, READY_SPEED] == pytest.approx(row[L.SPEED], abs=1e-2)
    turned = math.degrees(at.ready[0, READY_HEADING]) - row[L.HEADING]
    assert (turned + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("target_m", "fails"), [(-FAR, False), (0.0, False), (2.0, True)])
def test_runs_have_a_target_of_their_own(target_m, fails):
    """One for all opponents; short of it the boat fails, whatever tables tell at once."""
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 35.0, 180.0), boat(30.0, 0.0, -90.0))
    rolled_out(at, -1.0, 120.0)
    at.threat_target_m[0], at.joint_target_m[0] = -FAR, target_m
    rated(at)
    assert 0.0 < at.joint_m[0] < 2.0
    assert at.fails[0] == fails


def test_a_manoeuvre_that_lets_thrust_go_before_several_is_lost():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 30.0, 180.0), boat(25.0, 5.0, -90.0))
    rolled_out(at, 1.0, 0.0, 0.0)
    assert at.ready[0, READY_SAMPLE] == -1.0
    at.look[0, 4] = 1.0  # where it is looked up first its thrust is still there
    rated(at)
    assert at.joint_m[0] == -at.radius[0, 1]


def test_what_is_known_of_a_path_is_what_would_be_found_again():
    random = np.random.default_rng(7)
    for _ in range(60):
        at = looked_around(boat(0.0, 0.0, 0.0, random.uniform(0.5, 3.0)), *around(random, 3))
        rolled_out(at, random.choice([-1.0, 1.0]), random.uniform(0.0, 180.0), done=1)
        at.threat_target_m[0], at.joint_target_m[0] = random.uniform(-1.0, 1.0), 0.5
        fresh = rated(at)
        assert at.pursuers_known[0]
        at.clear[0, MARGIN], at.bound[0] = FAR, -1
        assert rated(at) == fresh
        at.pursuers_known[:], at.lookup[:] = False, np.nan
        assert rated(at) == fresh


def test_nothing_is_known_of_a_path_whose_search_stopped_or_of_another_path():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 8.0, 180.0), boat(6.0, 5.0, -90.0))
    rolled_out(at)
    at.threat_target_m[0] = 1.0
    worst_clearance(0, 0, at.scene, -FAR)
    worst_pursuer(0, 0, 0.5, at.scene)
    assert at.fails[0]
    assert not at.pursuers_known[0]
    rated(at)
    assert at.pursuers_known[0]
    rolled_out(at, -1.0)
    assert not at.pursuers_known[0]
    rated(at)
    run_opponents(1, at.scene)
    assert not at.pursuers_known[0]


def test_a_look_up_is_kept_for_its_place_only():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0))
    rolled_out(at, done=1)
    for column, change in [(None, 0.0), (0, 0.5), (1, 0.5), (2, 0.1), (3, -0.5), (None, 0.0)]:
        if column is not None:
            at.look[0, column] += change
        for _ in range(2):
            assert worst_at_once(0, 1, 0, at.scene) == margin_at_once(0, 1, 0, -FAR, at.scene)


def test_the_margin_of_runs_is_remembered_once_for_all_opponents():
    """And asked for at the rate of margins of manoeuvres; of each opponent the look-up at once is remembered."""
    rows = boat(0.0, 0.0, 0.0), boat(0.0, 35.0, 180.0), boat(30.0, 0.0, -90.0)
    at = stages_of(ShieldConfig(profile="ramming"), np.array(rows), ["surveyor"] * 3, [0, 1, 1])
    screened(at, np.array([[3.0, -90.0]] * 3))
    decided(at)
    assert at.memory[0, JOINT_MARGIN] == at.joint_m[0] == pytest.approx(1.0, abs=1.0)
    np.testing.assert_array_equal(at.memory[0, N_MEMORY:], at.threats_m[0])
    screened(at, np.array([[3.0, -90.0]] * 3))
    least_m = math.exp(-0.1) * min(at.memory[0, JOINT_MARGIN], at.boats.cap_m[0])
    assert at.joint_target_m[0] == pytest.approx(least_m)
    alone = stages_of(ShieldConfig(profile="ramming"), np.array(rows[:2]), ["surveyor"] * 2, [0, 1])
    alone.memory[0, JOINT_MARGIN] = 1.0
    screened(alone, np.array([[3.0, -90.0]] * 2))
    decided(alone)
    assert alone.memory[0, JOINT_MARGIN] == 0.0
