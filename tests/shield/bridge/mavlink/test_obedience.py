"""A boat that does not do as told is found; one that does never is, however wild its orders."""

import math

import numpy as np
import pytest
from steerclear.shield.bridge.mavlink.obedience import PATIENCE_S, STOP_S, Obedience
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

DT_S = 0.1


def watched(platform, orders, *, obeyed=None, delay_steps=0):
    """When and how disobedience is found of a boat told ``orders`` that obeys ``obeyed``, by default the same."""
    params, row, watch, found = get_platform(platform).pack(), fresh_state(0.0, 0.0, 0.0, 0.0), Obedience(), []
    obeyed = orders if obeyed is None else obeyed
    for k, (heading, speed) in enumerate(orders):
        now, before = k * DT_S, row[L.HEADING]
        watch.told(math.radians(heading), speed, now)
        wanted, knots = obeyed[max(0, k - delay_steps)]
        step_boat(params, row, knots, (wanted - row[L.HEADING] + 180.0) % 360.0 - 180.0, DT_S)
        rate = ((row[L.HEADING] - before + 180.0) % 360.0 - 180.0) / DT_S
        text = watch.fault(math.radians(row[L.HEADING]), math.radians(rate), row[L.SPEED], now)
        if text:
            found.append((now, text))
    return found


def wild(seed, hold_steps, steps=3000):
    """Random headings and speeds, each held for a while."""
    random = np.random.default_rng(seed)
    orders = []
    while len(orders) < steps:
        order = (float(random.uniform(0.0, 360.0)), float(random.uniform(0.3, 2.0)))
        orders += [order] * int(random.integers(1, hold_steps + 1))
    return orders[:steps]


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
@pytest.mark.parametrize("hold_steps", [1, 10, 40, 150])
def test_a_boat_that_obeys_is_never_accused(platform, hold_steps):
    for seed in range(3):
        assert watched(platform, wild(seed, hold_steps), delay_steps=3) == []


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
def test_stopping_on_order_is_no_fault(platform):
    assert watched(platform, [(90.0, 9.0)] * 300 + [(90.0, 0.0)] * 400) == []


@pytest.mark.parametrize("platform", ["heron", "surveyor"])
@pytest.mark.parametrize("sweep_dps", [2.0, 6.0, 10.0, 14.0, 20.0, 30.0])
@pytest.mark.parametrize("back_s", [3.0, 6.0, 15.0])
def test_headings_that_sweep_accuse_nobody(platform, sweep_dps, back_s):
    """A shield that steers by the autopilot's own derivative sweeps the heading it tells: the boat turns against it."""
    time_s = DT_S * np.arange(1500)
    swept = sweep_dps * (back_s / 2.0 - np.abs(time_s % (2.0 * back_s) - back_s))
    for ahead in (0.0, 60.0, 120.0, 170.0):
        orders = [(float(90.0 + ahead + heading), 3.0) for heading in swept]
        assert watched(platform, orders, delay_steps=1) == []
    round_and_round = [(float(sweep_dps * t), 3.0) for t in time_s]
    assert watched(platform, round_and_round, delay_steps=1) == []


def test_headings_that_keep_half_a_turn_away_from_the_boat_accuse_nobody():
    """As a shield tells a surveyor to turn as hard as it can, first to one side, then to the other."""
    params, row, watch, found = get_platform("surveyor").pack(), fresh_state(0.0, 0.0, 0.0, 2.0), Obedience(), []
    rate = 0.0
    for k in range(1200):
        told = row[L.HEADING] + 120.0 * math.sin(0.04 * k)
        watch.told(math.radians(told), 3.0, k * DT_S)
        before = row[L.HEADING]
        step_boat(params, row, 3.0, (told - row[L.HEADING] + 180.0) % 360.0 - 180.0, DT_S)
        rate = ((row[L.HEADING] - before + 180.0) % 360.0 - 180.0) / DT_S
        found += [watch.fault(math.radians(row[L.HEADING]), math.radians(rate), row[L.SPEED], k * DT_S)]
    assert set(found) == {""}


def test_a_second_commander_nobody_sees_is_found():
    orders = [(90.0, 1.5)] * 600
    theirs = [(90.0, 1.5)] * 100 + [(90.0 - 1.6 * k, 1.5) for k in range(500)]
    found = watched("heron", orders, obeyed=theirs)
    assert found
    assert found[0][0] < 10.0 + 12.0
    assert "turns away from the heading it is told" in found[0][1]


def test_a_boat_that_runs_on_is_found():
    found = watched("heron", [(0.0, 1.5)] * 100 + [(0.0, 0.0)] * 200, obeyed=[(0.0, 1.5)] * 300)
    assert found[0][0] == pytest.approx(10.0 + STOP_S, abs=0.2)
    assert "told to stop 10 s ago and makes 1." in found[0][1]


def test_nothing_is_found_of_a_boat_that_was_told_nothing_or_says_nothing():
    watch = Obedience()
    for k in range(300):
        assert watch.fault(1.0, 0.5, 2.0, k * DT_S) == ""
    for k in range(300):
        watch.told(1.0, 1.0, k * DT_S)
        assert watch.fault(math.nan, math.nan, math.nan, k * DT_S) == ""


def test_a_boat_just_told_to_turn_back_is_given_time():
    watch = Obedience()
    watch.told(0.0, 1.0, 0.0)
    for k in range(round(PATIENCE_S / DT_S)):
        assert watch.fault(1.0, 0.5, 1.0, k * DT_S) == ""
