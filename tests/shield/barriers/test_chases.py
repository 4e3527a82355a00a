"""Opponents no faster than a boat are followed for half a minute, over a straight run that is not stepped through."""

import math
from dataclasses import replace

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.paths import Manoeuvre, Span, sail, trace_path
from steerclear.shield.backup.rollout import roll_out
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.pursuit import clear_of_pursuer
from steerclear.shield.model import CHASE_S, boats_of
from steerclear.shield.platforms import PLATFORMS, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

TOP_MPS = 2.0
STEP_S = 0.02


def boats(own, other, **settings):
    return boats_of(ShieldConfig(**settings), (own, other), (0, 1))


def any_boat(random, params):
    """State and commanded speed, m/s: drawn at random, or of a boat that has held a speed for a while."""
    top = float(params[L.MAX_SPEED])
    row = fresh_state(0.0, 0.0, random.uniform(0.0, 360.0), random.uniform(0.0, top))
    row[L.THRUST] = random.uniform(0.0, 100.0)
    if random.random() < 0.5:
        row[[L.SPEED_ERROR, L.HEADING_ERROR]] = 0.0
        held_mps = random.uniform(0.0, top)
        for _ in range(random.integers(300)):
            sail(params, row, 1.0, 0.0, held_mps, 0.1)
    return row, random.choice([top, 0.0, random.uniform(0.0, top)])


def kinds():
    """Thrust boats of every kind there is, and one whose thrust ends before its map does."""
    shipped = [get_platform(name) for name in PLATFORMS]
    found = {boat.name: boat for boat in shipped if boat.kind == "usv" and boat.rotate_speed_dps == 0.0}
    return {**found, "held heron": replace(found["heron"], max_thrust=90.0)}


@pytest.mark.parametrize(("dt_s", "stride"), [(0.1, 1), (0.1, 2), (0.1, 4), (0.25, 1), (0.5, 1), (0.5, 2)])
@pytest.mark.parametrize("name", kinds())
def test_a_straight_run_whose_speed_settles_is_where_the_model_says(name, dt_s, stride):
    """The speed of what is left of the way settles by a rule: no step of the model is needed for it."""
    random, params = np.random.default_rng(stride), kinds()[name].pack()
    samples = min(217, int(60.0 / (stride * dt_s)))
    span = Span(dt_s, 1, stride, samples, 28, 151, 0, 85.0)
    for _ in range(15):
        row, speed = any_boat(random, params)
        togo = random.choice([0.0, 30.0, 90.0, 180.0])
        path, ready = np.full((400, 2), np.nan), np.zeros(4)
        trace_path(params, row.copy(), Manoeuvre(1.0, togo, speed), span, path, ready)
        last = samples if ready[0] < 0 else min(samples, max(28, int(ready[0]) + 151))
        there = np.zeros((last + 1, 2))
        for place in there:
            place[:] = row[L.X], row[L.Y]
            for _ in range(stride):
                togo = sail(params, row, 1.0, togo, speed, dt_s)
        np.testing.assert_allclose(path[: last + 1], there, rtol=0, atol=1e-2)


def sailed_m(bearing_deg, far_m, lead_s, lasts_s):
    """Least distance to a boat that sails north at top speed of one that steers at where it will be, in fine steps."""
    bearing, turn = math.radians(bearing_deg), math.radians(get_turn_dps()) * STEP_S
    x, y, heading, own, least = far_m * math.sin(bearing), far_m * math.cos(bearing), 0.0, 0.0, math.inf
    for _ in range(int(lasts_s / STEP_S)):
        lead = min(lead_s, meeting_s(x, y - own))
        wanted = math.atan2(-x, own + lead * TOP_MPS - y)
        error = (wanted - heading + math.pi) % (2.0 * math.pi) - math.pi
        heading += max(-turn, min(turn, error))
        x, y = x + TOP_MPS * STEP_S * math.sin(heading), y + TOP_MPS * STEP_S * math.cos(heading)
        own += TOP_MPS * STEP_S
        least = min(least, math.hypot(x, y - own))
    return least


def meeting_s(x, y):
    """When one at (x, y), as fast as a boat at the origin that sails north, can meet it, s: never from behind."""
    return (x * x + y * y) / (2.0 * TOP_MPS * y) if y > 0.0 else math.inf


def get_turn_dps():
    return float(boats("heron", "heron").granted_turn_dps[1])


def table_m(bearing_deg, far_m, **settings):
    """Margin from the same pursuer on a straight run, beyond what has to be kept, as the certificate sees it."""
    bearing = math.radians(bearing_deg)
    own = fresh_state(0.0, 0.0, 0.0, TOP_MPS)
    other = fresh_state(far_m * math.sin(bearing), far_m * math.cos(bearing), 0.0, TOP_MPS)
    own[L.THRUST] = other[L.THRUST] = 100.0
    rows = np.array([own, other])
    at = stages_of(
        ShieldConfig(**{"profile": "ramming", "buffer_m": 0.0, "margin_cap_m": 50.0, **settings}),
        rows,
        ["heron"] * 2,
        [0, 1],
    )
    find_neighbours(at.scene)
    roll_out(0, 0, 1.0, 0.0, TOP_MPS, 0, at.scene)
    return clear_of_pursuer(0, 1, 0, -1e6, at.scene)


@pytest.mark.parametrize(
    ("bearing_deg", "far_m"), [(95.0, 9.0), (100.0, 7.0), (110.0, 8.0), (120.0, 6.0), (90.0, 20.0)]
)
def test_who_closes_in_from_the_quarter_is_seen_coming_for_half_a_minute(bearing_deg, far_m):
    """Against a pursuit of its own, in steps a tenth as long, that leads the boat as much."""
    reached = sailed_m(bearing_deg, far_m, 0.3 * CHASE_S, CHASE_S)
    margin = table_m(bearing_deg, far_m)
    if margin >= 0.0:
        assert margin == pytest.approx(reached - 2.5, abs=0.2)
    else:
        assert reached < 2.6
    assert (
        margin
        <= table_m(bearing_deg, far_m, adversary_horizon_s=9.0) + 0.05
        <= table_m(bearing_deg, far_m, adversary_horizon_s=1.0) + 0.1
    )
