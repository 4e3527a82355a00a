"""Beyond the ranges told, a table tells enough at every heading and speed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.known_range import known_ranges_m
from steerclear.shield.tables.lookup import WHOLE_S, own_speed_cell, table_value

LEAST_M = 5.0
KINDS = [("surveyor", "surveyor"), ("surveyor", "heron"), ("heron", "heron")]
SHIPPED = [load_table(*kind) for kind in KINDS]
TABLES, RANGES = stack_tables(SHIPPED), known_ranges_m(SHIPPED, LEAST_M)

angles = st.floats(-np.pi, np.pi)
speeds = st.floats(0.0, 4.0)


@pytest.mark.parametrize("number", range(len(KINDS)))
@given(st.floats(0.0, 100.0), angles, angles, speeds, speeds)
def test_beyond_them_a_table_tells_enough(number, beyond_m, bearing, heading, own_mps, other_mps):
    table_m = RANGES[number, own_speed_cell(TABLES, number, own_mps)]
    if not np.isfinite(table_m):
        return
    far = table_m + beyond_m
    place = far * np.sin(bearing), far * np.cos(bearing)
    assert table_value(TABLES, number, WHOLE_S, *place, 0.0, heading, own_mps, other_mps) >= LEAST_M - 1e-9


@pytest.mark.parametrize("number", range(len(KINDS)))
def test_just_within_them_it_does_not(number):
    """They are no farther than they must be: by one step of the ranges at most."""
    table, steps = SHIPPED[number], SHIPPED[number].values
    grid = table.card.make_grid()
    ranges = grid.ranges_m()
    for cell, table_m in enumerate(RANGES[number, : grid.n_own - 1]):
        if np.isfinite(table_m):
            node = int(np.argmin(abs(ranges - table_m)))
            assert ranges[node] == table_m
            assert steps[node - 1, :, :, cell : cell + 2].min() < LEAST_M * 255.0 / grid.cap_m


def test_of_a_table_that_tells_too_little_there_is_none():
    assert np.isinf(known_ranges_m(SHIPPED, 1e3)).all()
    assert (known_ranges_m(SHIPPED[:1], 0.0) == 0.0).all()


def test_no_tables_have_no_ranges():
    assert known_ranges_m([], 5.0).shape == (0, 0)


def test_cells_of_smaller_tables_are_filled_up_with_nothing_known():
    for number, table in enumerate(SHIPPED):
        assert np.isinf(RANGES[number, table.card.make_grid().n_own - 1 :]).all()
