"""Boats that several opponents can come near to: these are rolled out for a while before they are looked up."""

import math

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.paths import READY_HEADING, READY_SAMPLE, READY_SPEED, sail
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

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
    roll_out(0, 0, side, turn_deg, speed_mps, done, at.scene)


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
