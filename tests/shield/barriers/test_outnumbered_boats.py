"""Boats that several opponents can come near to: these are run through for a while before they are looked up."""

import math

import numpy as np
import pytest
from stages import decided, screened, stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.laying import lay_path
from steerclear.shield.backup.paths import (
    READY_HEADING,
    READY_SAMPLE,
    READY_SPEED,
    Manoeuvre,
    Span,
    sail,
    trace_path,
)
from steerclear.shield.barriers.boats import worst_clearance
from steerclear.shield.barriers.clearance import FAR, MARGIN
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.opponents import _run_pursuer, closing, pursuit_of, worst_pursuer
from steerclear.shield.barriers.value_function import margin_at_once, out_of_reach, run_opponents, worst_at_once
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, table_value

SECONDS = 3.0
"""Time over which they are run through."""


def boat(x, y, heading_deg, speed_mps=3.0):
    row = fresh_state(x, y, heading_deg, speed_mps)
    row[[L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = 100.0, 3.0 - speed_mps, 0.0
    return row


def looked_around(*rows):
    """The first boat is ours, all are surveyors."""
    at = stages_of(
        ShieldConfig(profile="rammers"), np.array(rows), ["surveyor"] * len(rows), [0] + [1] * (len(rows) - 1)
    )
    find_neighbours(at.scene)
    return at


def laid(at, side=1.0, turn_deg=90.0, speed_mps=3.0, done=0):
    at.work.next_state[0] = at.state[0]
    lay_path(0, 0, side, turn_deg, speed_mps, done, at.scene)


def around(random, count):
    """Opponents all about, on their way to a boat at the origin."""
    rows = []
    for angle in random.uniform(-math.pi, math.pi, count):
        far, heading = random.uniform(12.0, 30.0), math.degrees(angle) + random.uniform(130.0, 230.0)
        rows.append(boat(far * math.sin(angle), far * math.cos(angle), heading, random.uniform(1.5, 3.0)))
    return rows


def test_one_opponent_outnumbers_nobody_and_two_that_the_tables_tell_of_do():
    ahead, abeam, far = boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0), boat(0.0, -500.0, 180.0)
    for others, outnumbered in [((ahead,), False), ((ahead, far), False), ((ahead, abeam), True)]:
        assert looked_around(boat(0.0, 0.0, 0.0), *others).work.outnumbered[0] == outnumbered


@pytest.mark.parametrize("thrust", [100.0, 91.0, 89.0, 30.0])
def test_a_boat_that_lacks_thrust_is_outnumbered_all_the_same(thrust):
    """Else it would be rated better for having slowed down: its opponents one by one, a moment later."""
    own = boat(0.0, 0.0, 0.0, 2.0)
    own[L.THRUST] = thrust
    assert looked_around(own, boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0)).work.outnumbered[0]


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
    least, ready = 2.0, at.work.ready[0]
    lasts = int(ready[READY_SAMPLE] + at.boats.pursuit_samples[0])
    pursuit = pursuit_of(0, j, 0, lasts, lasts, True, at.scene)
    for manner in range(6):
        margin_m, faded = _run_pursuer(0, j, 0, manner, pursuit, at.scene, -FAR, 2.0)
        least = min(least, margin_m)
        pursuer = at.work.pursuer
        there = pursuer[:2] - at.work.path[0, int(ready[READY_SAMPLE])]
        headings = ready[READY_HEADING], math.atan2(pursuer[2], pursuer[3])
        value = table_value(tables, 0, WHOLE_S, *there, *headings, ready[READY_SPEED], pursuer[4])
        if value < 6.0 - 1e-9:
            margin = value - at.work.radius[0, j] - at.boats.table_margin_m
            least = min(least, margin if margin >= 0.0 else margin * faded)
    return least


def rated(at):
    """Margins against the opponents on the path laid for the first boat, nothing known before."""
    at.work.pursuers_known[:] = False
    at.work.lookup[:] = np.nan
    worst_clearance(0, 0, at.scene, -FAR)
    worst_pursuer(0, 0, at.scene, -FAR)
    work = at.work
    told = work.joint_m[0], work.threat_m[0], work.fails[0], work.sealed[0], work.clear[0, MARGIN], work.bound[0]
    return (*work.threats_m[0], *told)


def test_each_opponent_has_its_look_up_at_once_and_all_have_the_least_of_their_runs():
    tables, random, at_once, later = stack_tables([load_table("surveyor", "surveyor")]), np.random.default_rng(3), 0, 0
    for _ in range(160):
        at = looked_around(boat(0.0, 0.0, 0.0, random.uniform(0.5, 3.0)), *around(random, 2))
        if not at.work.outnumbered[0]:
            continue
        laid(at, -1.0, 60.0)
        at.work.threat_target_m[0], at.work.joint_target_m[0] = -FAR, -FAR
        rated(at)
        first = [margin_at_once(0, j, 0, -FAR, at.boats, at.work) for j in (1, 2)]
        runs = [run_and_looked_up(at, j, tables) for j in (1, 2)]
        np.testing.assert_array_equal(at.work.threats_m[0, 1:], first)
        assert at.work.joint_m[0] == pytest.approx(min(runs), abs=1e-9)
        assert at.work.threat_m[0] == pytest.approx(min(first + runs), abs=1e-9)
        at_once += min(first) < min(runs)
        later += min(runs) < min(first)
    assert at_once > 10
    assert later > 10


@pytest.mark.parametrize(("target_m", "fails"), [(-FAR, False), (0.0, False), (2.0, True)])
def test_runs_have_a_target_of_their_own(target_m, fails):
    """One for all opponents; short of it the boat fails, whatever tables tell at once."""
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 35.0, 180.0), boat(30.0, 0.0, -90.0))
    laid(at, -1.0, 120.0)
    at.work.threat_target_m[0], at.work.joint_target_m[0] = -FAR, target_m
    rated(at)
    assert 0.0 < at.work.joint_m[0] < 2.0
    assert at.work.fails[0] == fails
    at.work.joint_m[0] = -1.0
    rated(at)
    assert at.work.joint_m[0] > 0.0


def test_a_manoeuvre_that_lets_thrust_go_before_several_is_lost():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 30.0, 180.0), boat(25.0, 5.0, -90.0))
    laid(at, 1.0, 0.0, 0.0)
    assert at.work.ready[0, READY_SAMPLE] == -1.0
    at.work.place[0, 4] = 1.0  # where it is looked up first its thrust is still there
    rated(at)
    assert at.work.joint_m[0] == -at.work.radius[0, 1]


def test_runs_left_out_would_have_ended_at_the_cap():
    random, left_out = np.random.default_rng(5), 0
    for _ in range(120):
        rows = [boat(0.0, 0.0, 0.0, random.uniform(2.0, 3.0))]
        for angle in random.uniform(-math.pi, math.pi, 3):
            far = random.uniform(15.0, 120.0)
            heading = random.uniform(-180.0, 180.0)
            rows.append(boat(far * math.sin(angle), far * math.cos(angle), heading, random.uniform(0.0, 3.0)))
        at = looked_around(*rows)
        if not at.work.outnumbered[0]:
            continue
        laid(at, random.choice([-1.0, 0.5]), random.uniform(0.0, 180.0), done=random.integers(0, 2))
        at.work.threat_target_m[0], at.work.joint_target_m[0] = 1.0, 1.5
        short, table_m = rated(at), at.boats.known_range_m.copy()
        for j in range(1, 4):
            closing_m = closing(0, j, at.scene)
            left_out += out_of_reach(0, j, 0, closing_m, at.scene)
        at.boats.known_range_m[:] = np.inf
        full = rated(at)
        at.boats.known_range_m[:] = table_m
        assert short == full
    assert left_out > 50


def test_wider_tracks_are_not_left_out():
    """The ranges hold for the radius of the settings; a track that may be further off is run through."""
    far = boat(0.0, 90.0, 0.0)
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0), far)
    laid(at)
    closing_m = closing(0, 3, at.scene)
    assert out_of_reach(0, 3, 0, closing_m, at.scene)
    at.work.radius[0, 3] += 0.01
    assert not out_of_reach(0, 3, 0, closing_m, at.scene)


def test_what_is_known_of_a_path_is_what_would_be_found_again():
    random = np.random.default_rng(7)
    for _ in range(60):
        at = looked_around(boat(0.0, 0.0, 0.0, random.uniform(0.5, 3.0)), *around(random, 3))
        laid(at, random.choice([-1.0, 1.0]), random.uniform(0.0, 180.0), done=1)
        at.work.threat_target_m[0], at.work.joint_target_m[0] = random.uniform(-1.0, 1.0), 0.5
        fresh = rated(at)
        assert at.work.pursuers_known[0]
        at.work.clear[0, MARGIN], at.work.bound[0] = FAR, -1
        worst_clearance(0, 0, at.scene, -FAR)
        worst_pursuer(0, 0, at.scene, -FAR)
        assert (at.work.clear[0, MARGIN], at.work.bound[0]) == fresh[-2:]
        assert (*at.work.threats_m[0],) == fresh[: len(at.state)]


def test_nothing_is_known_of_a_path_whose_search_stopped_or_of_another_path():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 8.0, 180.0), boat(6.0, 5.0, -90.0))
    laid(at)
    at.work.threat_target_m[0] = 1.0
    worst_clearance(0, 0, at.scene, -FAR)
    worst_pursuer(0, 0, at.scene, 0.5)
    assert at.work.fails[0]
    assert not at.work.pursuers_known[0]
    rated(at)
    assert at.work.pursuers_known[0]
    laid(at, -1.0)
    assert not at.work.pursuers_known[0]
    rated(at)
    run_opponents(1, at.scene)
    assert not at.work.pursuers_known[0]


def test_a_look_up_is_kept_for_its_place_only():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0))
    laid(at, done=1)
    for column, change in [(None, 0.0), (0, 0.5), (1, 0.5), (2, 0.1), (3, -0.5), (None, 0.0)]:
        if column is not None:
            at.work.place[0, column] += change
        for _ in range(2):
            margin = margin_at_once(0, 1, 0, -FAR, at.boats, at.work)
            assert worst_at_once(0, 1, 0, at.boats, at.work) == margin


def test_the_margin_of_runs_is_remembered_once_for_all_opponents():
    """And asked for at the rate of margins of manoeuvres; of each opponent the look-up at once is remembered."""
    rows = boat(0.0, 0.0, 0.0), boat(0.0, 35.0, 180.0), boat(30.0, 0.0, -90.0)
    at = stages_of(ShieldConfig(profile="rammers"), np.array(rows), ["surveyor"] * 3, [0, 1, 1])
    screened(at, np.array([[3.0, -90.0]] * 3))
    decided(at)
    assert at.memory.joint_m[0] == at.work.joint_m[0] == pytest.approx(1.0, abs=1.0)
    np.testing.assert_array_equal(at.memory.threat_m[0], at.work.threats_m[0])
    screened(at, np.array([[3.0, -90.0]] * 3))
    assert at.work.joint_target_m[0] == pytest.approx(math.exp(-0.1) * min(at.memory.joint_m[0], at.boats.cap_m[0]))
    alone = stages_of(ShieldConfig(profile="rammers"), np.array(rows[:2]), ["surveyor"] * 2, [0, 1])
    alone.memory.joint_m[0] = 1.0
    screened(alone, np.array([[3.0, -90.0]] * 2))
    decided(alone)
    assert alone.memory.joint_m[0] == 0.0


def test_a_boat_of_one_opponent_is_looked_up_and_not_run_through():
    at = looked_around(boat(0.0, 0.0, 0.0), boat(0.0, 20.0, 180.0))
    laid(at)
    at.work.threat_target_m[0] = -FAR
    rated(at)
    assert at.work.threats_m[0, 1] == margin_at_once(0, 1, 0, -FAR, at.boats, at.work)
    assert at.work.joint_m[0] == FAR


@pytest.mark.parametrize("speed_mps", [0.5, 2.0, 3.0])
@pytest.mark.parametrize("turn_deg", [0.0, 30.0])
def test_nothing_is_noted_beyond_the_end_of_a_path(speed_mps, turn_deg):
    """A path that ends before runs do, of short settings, is looked up where it ends or not at all."""
    at = looked_around(boat(0.0, 0.0, 0.0, speed_mps), boat(0.0, 20.0, 180.0), boat(15.0, 5.0, -90.0))
    for samples in range(1, 12):
        path, ready = np.full((samples + 1, 2), np.nan), np.full(4, -1.0)
        for earliest in range(samples + 1):
            trace_path(
                at.boats.params[0],
                at.state[0].copy(),
                Manoeuvre(1.0, turn_deg, 3.0),
                Span(0.1, 1, at.boats.stride, samples, samples, 0, earliest, at.boats.ready_thrust[0]),
                path,
                ready,
            )
            assert ready[READY_SAMPLE] <= samples
            assert np.isfinite(path).all()
    pursuit, thrust = at.boats.pursuit_samples.copy(), at.boats.thrust_samples.copy()
    at.boats.pursuit_samples[0], at.boats.thrust_samples[0] = 3, 0
    try:
        laid(at, 1.0, turn_deg)
        assert at.work.ready[0, READY_SAMPLE] <= 3
    finally:
        at.boats.pursuit_samples[:], at.boats.thrust_samples[:] = pursuit, thrust
