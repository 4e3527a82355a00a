"""Boats whose thrust is not full: run through until it is, then looked up."""

import math

import numpy as np
import pytest
from shield_loops import step_all
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.certificates.clearance import MARGIN
from steerclear.shield.certificates.hunters import clear_of_hunter
from steerclear.shield.certificates.laying import HUNTERS, HUNTERS_TILL_READY, NO_HUNTERS, hunters_run, lay_path
from steerclear.shield.certificates.manoeuvre import look_around
from steerclear.shield.certificates.paths import READY_HEADING, READY_SAMPLE, READY_SPEED, sail
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import table_value

SURVEYOR = get_platform("surveyor")


def slow_boat(speed_mps=1.0, thrust=20.0):
    row = fresh_state(0.0, 0.0, 0.0, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = thrust, 0.0, 0.0
    return row


def opponent(x, y, heading_deg):
    row = fresh_state(x, y, heading_deg, 3.0)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = 100.0, 0.0, 0.0
    return row


def stages(*rows, other="surveyor", **settings):
    at = stages_of(
        ShieldConfig(**settings), np.array(rows), ["surveyor"] + [other] * (len(rows) - 1), [0] + [1] * (len(rows) - 1)
    )
    look_around(at.state, np.zeros(len(rows)), at.ours, at.boats, at.tuning, at.work)
    return at


def laid(at, side=1.0, turn_deg=90.0, speed_mps=3.0, done=0):
    lay_path(0, 0, side, turn_deg, speed_mps, done, at.state, at.boats, at.tuning, at.work)


@pytest.mark.parametrize(("side", "turn_deg"), [(1.0, 0.0), (-1.0, 90.0), (0.5, 180.0)])
def test_it_is_noted_where_thrust_is_full_by_the_full_model(side, turn_deg):
    at = stages(slow_boat(), opponent(0.0, 40.0, 180.0))
    laid(at, side, turn_deg)
    row, togo, step, params = slow_boat(), turn_deg, 0, SURVEYOR.pack()
    while row[L.THRUST] < 90.0 or (step - 1) % at.boats.stride or step < at.boats.look[0]:
        togo = sail(params, row, side, togo, 3.0, 0.1)
        step += 1
    k = (step - 1) // at.boats.stride
    assert at.work.ready[0, READY_SAMPLE] == k > 0
    np.testing.assert_allclose(at.work.path[0, k], row[:2], atol=1e-9)
    assert at.work.ready[0, READY_SPEED] == pytest.approx(row[L.SPEED], abs=1e-9)
    turned = math.degrees(at.work.ready[0, READY_HEADING]) - row[L.HEADING]
    assert (turned + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-7)


def test_what_comes_after_is_the_value_of_the_table():
    tables, met = stack_tables([load_table("surveyor", "surveyor")]), 0
    random = np.random.default_rng(2)
    for _ in range(800):
        angle, far = random.uniform(-math.pi, math.pi), random.uniform(15.0, 60.0)
        at = stages(
            slow_boat(),
            opponent(far * math.sin(angle), far * math.cos(angle), math.degrees(angle) + random.uniform(90.0, 270.0)),
        )
        laid(at, 1.0, 90.0)
        clear_of_hunter(0, 1, 0, at.state, at.ours, at.boats, at.tuning, at.work, -1e6, 1e6)
        told, k, hunter = at.work.out[MARGIN], int(at.work.ready[0, READY_SAMPLE]), at.work.hunter  # the last manner's
        there = hunter[:2] - at.work.path[0, k]
        headings = at.work.ready[0, READY_HEADING], math.atan2(hunter[2], hunter[3])
        value = table_value(tables, 0, *there, *headings, at.work.ready[0, READY_SPEED], hunter[4])
        margin = value - at.work.radius[0, 1] - at.boats.table_margin_m
        if margin >= 0.0 and value < 6.0 - 1e-9:
            assert told <= margin + 1e-9
            met += 1
    assert met > 3


def test_hunters_are_run_through_only_as_far_as_needed():
    ahead = opponent(0.0, 30.0, 180.0)
    for rows, other, how in [
        ((opponent(0.0, 0.0, 0.0), ahead), "surveyor", NO_HUNTERS),
        ((slow_boat(), ahead), "surveyor", HUNTERS_TILL_READY),
        ((slow_boat(), ahead), "large_usv", HUNTERS),
    ]:
        at = stages(*rows, other=other)
        laid(at)
        assert hunters_run(0, 0, at.boats, at.work) == how


def test_a_boat_that_never_gets_its_thrust_back_is_run_through_to_the_end():
    at = stages(slow_boat(), opponent(0.0, 30.0, 180.0))
    laid(at, 1.0, 0.0, 0.0)
    assert at.work.ready[0, READY_SAMPLE] == -1.0
    clear_of_hunter(0, 1, 0, at.state, at.ours, at.boats, at.tuning, at.work, -1e6, 50.0)
    assert at.work.out[MARGIN] < 0.0


def chased(certificate, count=40, steps=500):
    """First certificates and closest distances of slow boats without thrust, each with a rammer that leads it."""
    rng, params = np.random.default_rng(8), SURVEYOR.pack()
    state = np.zeros((count, 2, L.N_STATE))
    for game in state:
        game[0] = slow_boat(rng.uniform(0.5, 2.0), 30.0)
        angle, far = rng.uniform(-math.pi, math.pi), rng.uniform(10.0, 60.0)
        game[1] = opponent(far * math.sin(angle), far * math.cos(angle), math.degrees(angle) + 180.0)
    shield = BatchedShield(ShieldConfig(certificate=certificate), count, ("surveyor",) * 2, (0, 1))
    ours, closest, first = np.tile([True, False], (count, 1)), np.full(count, math.inf), None
    for _ in range(steps):
        wanted = np.zeros((count, 2, 2))
        wanted[:, :, 0] = 3.0
        wanted[:, 1, 1] = bearing_to_quarry(state)
        sent = shield.decide(state, wanted, ours)
        first = shield.certificate_m[:, 0].copy() if first is None else first
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


def test_who_is_promised_an_escape_gets_it():
    first, closest = chased("auto")
    assert (first >= 0.0).sum() > 10
    assert (closest[first >= 0.0] >= 2.5).all()


def test_more_are_promised_one_than_by_running_hunters_through_for_minutes():
    first, _ = chased("auto", steps=1)
    minutes, _ = chased("turning_circle", steps=1)
    assert (first >= 0.0).sum() > (minutes >= 0.0).sum()
