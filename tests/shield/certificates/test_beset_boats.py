"""Boats that several opponents can come near to: these are run through for a while before they are looked up."""

import math

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.certificates.clearance import FAR, MARGIN
from steerclear.shield.certificates.hunters import _run_hunter, worst_hunter
from steerclear.shield.certificates.laying import lay_path
from steerclear.shield.certificates.manoeuvre import look_around, worst_clearance
from steerclear.shield.certificates.paths import READY_HEADING, READY_SAMPLE, READY_SPEED, sail
from steerclear.shield.certificates.values import margin_at_once
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import table_value

SECONDS = 3.0
"""Time over which they are run through."""


def boat(x, y, heading_deg, speed_mps=3.0):
    row = fresh_state(x, y, heading_deg, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = 100.0, 3.0 - speed_mps, 0.0
    return row


def looked_around(*rows):
    """The first boat is ours, all are surveyors."""
    at = stages_of(ShieldConfig(), np.array(rows), ["surveyor"] * len(rows), [0] + [1] * (len(rows) - 1))
    look_around(at.state, np.zeros(len(rows)), at.ours, at.boats, at.tuning, at.work)
    return at


def laid(at, side=1.0, turn_deg=90.0, speed_mps=3.0, done=0):
    at.work.next_state[0] = at.state[0]
    lay_path(0, 0, side, turn_deg, speed_mps, done, at.state, at.boats, at.tuning, at.work)


def around(random, count):
    """Opponents all about, on their way to a boat at the origin."""
    rows = []
    for angle in random.uniform(-math.pi, math.pi, count):
        far, heading = random.uniform(12.0, 30.0), math.degrees(angle) + random.uniform(130.0, 230.0)
        rows.append(boat(far * math.sin(angle), far * math.cos(angle), heading, random.uniform(1.5, 3.0)))
    return rows


def test_one_opponent_besets_nobody_and_two_that_the_tables_tell_of_do():
    ahead, abeam, far = boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0), boat(0.0, -200.0, 0.0)
    for others, beset in [((ahead,), False), ((ahead, far), False), ((ahead, abeam), True)]:
        assert looked_around(boat(0.0, 0.0, 0.0), *others).work.beset[0] == beset


@pytest.mark.parametrize("done", [0, 1])
@pytest.mark.parametrize(
    ("speed_mps", "side", "turn_deg"),
    [(3.0, 1.0, 0.0), (3.0, -1.0, 90.0), (1.0, 1.0, 0.0), (1.0, 0.5, 120.0), (2.999, 1.0, 3.0)],
)
def test_runs_end_after_some_seconds_where_the_full_model_is(done, speed_mps, side, turn_deg):
    at = looked_around(boat(0.0, 0.0, 0.0, speed_mps), boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0))
    laid(at, side, turn_deg, done=done)
    k = int(at.work.ready[0, READY_SAMPLE])
    assert SECONDS <= k * at.boats.sample_s < SECONDS + at.boats.sample_s
    row, togo = at.state[0].copy(), turn_deg
    for _ in range(k * at.boats.stride + 1 - done):
        togo = sail(at.boats.params[0], row, side, togo, 3.0, at.tuning.dt_s)
    np.testing.assert_allclose(at.work.path[0, k], row[:2], atol=1e-3)
    assert at.work.ready[0, READY_SPEED] == pytest.approx(row[L.SPEED], abs=1e-2)
    turned = math.degrees(at.work.ready[0, READY_HEADING]) - row[L.HEADING]
    assert (turned + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)


def run_and_looked_up(at, j, tables):
    """Least margin of opponent j over all its manners, by runs and by the table at their ends."""
    least, ready = FAR, at.work.ready[0]
    lasts = int(ready[READY_SAMPLE] + at.boats.hunt_samples[0])
    for manner in range(6):
        faded = _run_hunter(0, j, 0, manner, lasts, True, at.state, at.boats, at.tuning, at.work, -FAR, 2.0)
        least = min(least, at.work.spare[MARGIN])
        hunter = at.work.hunter
        there = hunter[:2] - at.work.path[0, int(ready[READY_SAMPLE])]
        headings = ready[READY_HEADING], math.atan2(hunter[2], hunter[3])
        value = table_value(tables, 0, *there, *headings, ready[READY_SPEED], hunter[4])
        if value < 6.0 - 1e-9:
            margin = value - at.work.radius[0, j] - at.boats.table_margin_m
            least = min(least, margin if margin >= 0.0 else margin * faded)
    return least


def test_the_margin_is_the_least_of_the_look_up_at_once_and_of_the_runs():
    tables, random, at_once, later = stack_tables([load_table("surveyor", "surveyor")]), np.random.default_rng(3), 0, 0
    for _ in range(160):
        at = looked_around(boat(0.0, 0.0, 0.0, random.uniform(0.5, 3.0)), *around(random, 2))
        if not at.work.beset[0]:
            continue
        laid(at, -1.0, 60.0)
        worst_clearance(0, 0, at.state, at.ours, at.boats, at.tuning, at.work, -FAR)
        at.work.threat_target_m[0] = -FAR
        worst_hunter(0, 0, at.state, at.ours, at.boats, at.tuning, at.work, -FAR)
        for j in (1, 2):
            first, runs = margin_at_once(0, j, 0, -FAR, at.boats, at.work), run_and_looked_up(at, j, tables)
            assert at.work.threats_m[0, j] == pytest.approx(min(first, runs), abs=1e-9)
            at_once += first < runs
            later += runs < first
    assert at_once > 10 < later


def test_a_boat_of_one_opponent_is_looked_up_and_not_run_through():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 20.0, 180.0))
    laid(at)
    worst_clearance(0, 0, at.state, at.ours, at.boats, at.tuning, at.work, -FAR)
    at.work.threat_target_m[0] = -FAR
    worst_hunter(0, 0, at.state, at.ours, at.boats, at.tuning, at.work, -FAR)
    assert at.work.threats_m[0, 1] == margin_at_once(0, 1, 0, -FAR, at.boats, at.work)
