"""Values and gradients looked up: against SciPy's interpolation, finite differences and symmetries."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from steerclear.shield.exceptions import TableError
from steerclear.shield.tables.files import stack_tables
from steerclear.shield.tables.grid import rho_place
from steerclear.shield.tables.lookup import (
    LEVELS_S,
    WHOLE_S,
    full_from_m,
    table_gradient,
    table_range_m,
    table_value,
)
from table_scenes import problem, random_table

TABLE = random_table()

TABLES = stack_tables([random_table(1, other="surveyor", n_rho=5, n_beta=4), TABLE])

FINITE = st.floats(-30.0, 30.0)

ANGLE = st.floats(-7.0, 7.0)

SPEED = st.floats(0.0, 2.0)


def scipy_value(table, dx, dy, own_heading, other_heading, own_speed, other_speed):
    """The same interpolation by other means: values unrolled over the turn, range axis clamped."""
    grid = table.card.make_grid()
    values = np.concatenate([table.values_m(), table.values_m()[:, :1]], axis=1)
    axes = (
        grid.ranges_m(),
        np.linspace(0.0, 2.0 * np.pi, grid.n_psi + 1),
        np.linspace(0.0, np.pi, grid.n_beta),
        grid.own_speeds_mps(),
        grid.other_speeds_mps(),
    )
    beta = math.remainder(math.atan2(dx, dy) - own_heading, 2.0 * math.pi)
    psi = other_heading - own_heading
    if beta < 0.0:
        beta, psi = -beta, -psi
    rho = math.hypot(dx, dy)
    if rho < grid.rho_first_m:
        return rho
    point = [min(rho, grid.rho_last_m), psi % (2.0 * math.pi), beta, own_speed, other_speed]
    return float(RegularGridInterpolator(axes, values)(point)[0])


def off_the_bow(x, y, own):
    """Dead ahead and dead astern rounding decides the side, and sides of random values differ."""
    return abs(math.remainder(math.atan2(x, y) - own, math.pi)) > 1e-6


@settings(max_examples=60, deadline=None)
@given(FINITE, FINITE, ANGLE, ANGLE, SPEED, SPEED)
def test_values_are_those_of_another_interpolation(x, y, own, other, v, w):
    state = x, y, own, other, v, w
    assume(off_the_bow(x, y, own))
    assert table_value(TABLES, 1, WHOLE_S, *state) == pytest.approx(scipy_value(TABLE, *state), abs=1e-9)
    assert table_gradient(TABLES, 1, WHOLE_S, *state).value_m == pytest.approx(
        table_value(TABLES, 1, WHOLE_S, *state), abs=1e-9
    )


def test_gradients_are_those_of_finite_differences():
    random, h, seen = np.random.default_rng(5), 1e-6, 0
    for _ in range(300):
        x, y = random.uniform(-9.0, 9.0, 2)
        state = np.array([x, y, *random.uniform(-4.0, 4.0, 2), *random.uniform(0.0, 2.0, 2)])
        slopes = []
        for i in range(6):
            ends = [table_value(TABLES, 1, WHOLE_S, *(state + sign * h * np.eye(6)[i])) for sign in (-1.0, 0.0, 1.0)]
            one_sided = (ends[1] - ends[0]) / h, (ends[2] - ends[1]) / h
            slopes.append(0.5 * sum(one_sided) if abs(one_sided[1] - one_sided[0]) < 1e-3 else math.nan)
        found = table_gradient(TABLES, 1, WHOLE_S, *state)
        by_position = [-found.own_x, -found.own_y, found.own_heading, found.other_heading]
        ours = np.array([*by_position, found.own_speed, found.other_speed])
        if not np.isnan(slopes).any():
            seen += 1
            np.testing.assert_allclose(ours, slopes, atol=2e-3, rtol=2e-4)
    assert seen > 250


def test_beyond_the_table_its_edge_holds():
    last = table_range_m(TABLES, 1)
    assert last == pytest.approx(12.0)
    edge, beyond = (
        table_value(TABLES, 1, WHOLE_S, far * 0.6, far * 0.8, 0.0, 1.0, 5.0, -1.0) for far in (last, 3.0 * last)
    )
    assert edge == pytest.approx(beyond, abs=1e-9)
    slope = table_gradient(TABLES, 1, WHOLE_S, 30.0, 40.0, 0.0, 1.0, 5.0, -1.0)
    assert slope.own_speed == slope.other_speed == 0.0
    assert 30.0 * slope.own_x + 40.0 * slope.own_y == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_what_is_not_finite_gives_nan(place, bad):
    state = [3.0, 4.0, 0.1, 0.2, 1.0, 1.0]
    state[place] = bad
    assert math.isnan(table_value(TABLES, 1, WHOLE_S, *state))
    assert all(math.isnan(part) for part in table_gradient(TABLES, 1, WHOLE_S, *state))


@settings(max_examples=40, deadline=None)
@given(FINITE, FINITE, ANGLE, ANGLE, SPEED, SPEED, st.floats(0.0, WHOLE_S))
def test_between_two_times_values_are_between_theirs_and_fall_with_time(x, y, own, other, v, w, fear_s):
    state = (x, y, own, other, v, w)
    times = [0.0, *LEVELS_S, WHOLE_S]
    values = [table_value(TABLES, 1, time_s, *state) for time_s in times]
    if math.hypot(x, y) > TABLE.card.make_grid().rho_first_m:
        assert values[0] == pytest.approx(min(math.hypot(x, y), 6.0))
    assert all(sooner >= later - 1e-12 for sooner, later in itertools.pairwise(values[1:]))
    assert table_value(TABLES, 1, fear_s, *state) == pytest.approx(np.interp(fear_s, times, values), abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(FINITE, FINITE, ANGLE, ANGLE, SPEED, SPEED, st.floats(0.5, 80.0))
def test_slopes_between_two_times_blend_theirs(x, y, own, other, v, w, fear_s):
    state = (x, y, own, other, v, w)
    times = [0.0, *LEVELS_S, WHOLE_S]
    slopes = np.array([table_gradient(TABLES, 1, time_s, *state) for time_s in times])
    found = table_gradient(TABLES, 1, fear_s, *state)
    expected = [np.interp(fear_s, times, slopes[:, k]) for k in range(7)]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_table_without_shorter_times_fears_for_the_whole_play():
    old = replace(TABLE, card=replace(TABLE.card, levels_s=()), levels=TABLE.levels[:0])
    tables, state = stack_tables([old]), (4.0, 5.0, 0.3, 2.0, 1.1, 0.7)
    for fear_s in (0.0, 1.0, 5.0, 50.0):
        assert table_value(tables, 0, fear_s, *state) == table_value(TABLES, 1, WHOLE_S, *state)


def test_beyond_a_range_there_is_nothing_but_the_cap():
    """Where every value of the farthest ranges is that, nothing is looked up; what is nearer is as before."""
    values = TABLE.values.copy()
    values[-3:] = 255
    far = stack_tables([replace(TABLE, values=values, levels=np.full_like(TABLE.levels, 255))])
    grid = TABLE.card.make_grid()
    from_m = full_from_m(far, 0, WHOLE_S)
    assert from_m == max(grid.cap_m, grid.ranges_m()[-3])
    assert full_from_m(far, 0, LEVELS_S[0]) == grid.cap_m
    assert table_value(far, 0, WHOLE_S, 0.0, from_m, 0.1, 0.2, 1.0, 1.0) == grid.cap_m
    assert table_value(far, 0, WHOLE_S, 0.0, from_m - 1e-9, 0.1, 0.2, 1.0, 1.0) == pytest.approx(grid.cap_m)
    assert math.isinf(full_from_m(TABLES, 1, WHOLE_S)) or (TABLE.values[-1] == 255).all()


GRID = problem().grid


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 20.0))
def test_places_and_ranges_belong_together(rho):
    i, place = rho_place(GRID.pack(), rho)
    ranges = GRID.ranges_m()
    assert ranges[i] + place * (ranges[i + 1] - ranges[i]) == pytest.approx(np.clip(rho, ranges[0], ranges[-1]))
    assert 0 <= i <= GRID.n_rho - 2
    assert 0.0 <= place <= 1.0


@pytest.mark.parametrize("name", ["n_rho", "n_psi", "n_beta", "n_own", "n_other"])
def test_an_axis_of_one_node_is_refused(name):
    with pytest.raises(TableError, match="at least 2 nodes"):
        replace(GRID, **{name: 1})
