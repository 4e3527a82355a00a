"""Boats that turn by a rate loop: the controller and its inverse, and the boats that come with the package."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import Fleet, Shield, ShieldConfig
from steerclear.shield.commands import Commands
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import cruise
from steerclear.shield.platforms.rate import error_for_rate, rate_for_error

STEPS = Path(__file__).parents[2] / "data" / "boat_steps"
RATE_BOATS = ("ardurover_boat", "blueboat", "otter")


@pytest.mark.parametrize("name", RATE_BOATS)
@given(rate=st.floats(-120.0, 120.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_error_that_asks_for_a_rate_asks_for_that_rate(name, rate):
    params = get_platform(name).pack()
    assert rate_for_error(params, error_for_rate(params, rate)) == pytest.approx(rate, abs=1e-9)


def test_an_otter_stops_and_turns_as_published():
    params, row = cruise(get_platform("otter"))
    assert row[L.SPEED] == pytest.approx(3.2, abs=0.01)
    while row[L.SPEED] > 0.05 * 3.2:
        step_boat(params, row, 0.0, 0.0, 0.1)
    assert math.hypot(row[L.X], row[L.Y]) == pytest.approx(4.0, abs=0.1)
    params, row = cruise(get_platform("otter"))
    steps = 0
    while abs(90.0 - row[L.HEADING]) > 5.0:
        step_boat(params, row, params[L.MAX_SPEED], 90.0 - row[L.HEADING], 0.1)
        steps += 1
    assert steps * 0.1 == pytest.approx(15.4, abs=0.2)


def test_the_shipped_rover_turns_as_the_recorded_one():
    """A right angle at 2 m/s: the heading stays within 6 deg of the record, a delay of 0.1 s allowed for."""
    with (STEPS / "ardurover_stock_heading90R_v2.csv").open() as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    times = np.array([row["t_s"] for row in rows])
    headings = np.array([row["yaw_deg_unwrapped"] for row in rows])
    params, boat = get_platform("ardurover_boat").pack(), fresh_state(0.0, 0.0, 0.0, 2.0)
    for k in range(80):
        seen = float(np.interp(0.1 * k, times, headings))
        assert boat[L.HEADING] == pytest.approx(seen, abs=6.0)
        step_boat(params, boat, 2.0, (90.0 if k >= 1 else 0.0) - boat[L.HEADING], 0.1)


def closest_m(name, seed, shielded=True):
    """Two boats meet head on, one of them ours: how near they come."""
    platform = get_platform(name)
    params, top = platform.pack(), platform.max_speed_mps
    random = np.random.default_rng(seed)
    states = np.array([fresh_state(0.0, 0.0, 0.0, top), fresh_state(random.uniform(-2, 2), 60.0, 180.0, top)])
    shield, nearest = Shield(ShieldConfig(dt_s=0.1)), math.inf
    for _ in range(200):
        error = [math.degrees(0.0) - states[0, L.HEADING], 180.0 - states[1, L.HEADING]]
        wanted = np.array([[top, math.remainder(e, 360.0)] for e in error])
        fleet = Fleet(states.copy(), np.array([0, 1]), (name, name), np.array([True, False]), ("ours", "theirs"))
        sent = shield.decide(fleet, Commands.relative_deg(wanted)).filtered.values if shielded else np.radians(wanted)
        for i in range(2):
            command = sent[i] if i == 0 and shielded else wanted[i]
            step_boat(params, states[i], command[0], command[1], 0.1)
        nearest = min(nearest, float(np.hypot(*(states[0, :2] - states[1, :2]))))
    return nearest


@pytest.mark.parametrize("name", RATE_BOATS)
def test_the_shield_keeps_them_apart_head_on(name):
    assert closest_m(name, 3, shielded=False) < 2.5
    assert closest_m(name, 3) >= 2.5
