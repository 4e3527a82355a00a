"""The grid: ranges and their places, bad numbers of nodes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.exceptions import TableError
from steerclear.shield.tables.grid import Grid, even_place, rho_place
from table_scenes import problem

GRID = problem().grid


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 20.0))
def test_places_and_ranges_belong_together(rho):
    i, place = rho_place(GRID.pack(), rho)
    ranges = GRID.ranges_m()
    assert ranges[i] + place * (ranges[i + 1] - ranges[i]) == pytest.approx(np.clip(rho, ranges[0], ranges[-1]))
    assert 0 <= i <= GRID.n_rho - 2
    assert 0.0 <= place <= 1.0


def test_ranges_run_from_end_to_end_and_widen_as_asked():
    gaps = np.diff(GRID.ranges_m())
    assert GRID.ranges_m()[[0, -1]] == pytest.approx([1.0, 12.0])
    assert gaps[-1] / gaps[0] == pytest.approx(GRID.rho_ratio)
    assert (np.diff(gaps) > 0.0).all()


@pytest.mark.parametrize(("value", "expected"), [(-1.0, (0, 0.0)), (0.0, (0, 0.0)), (2.25, (2, 0.25)), (4.0, (3, 1.0))])
def test_even_places_are_clamped(value, expected):
    assert even_place(value, 4) == expected
    assert even_place(float("nan"), 4) == (0, 0.0)


@pytest.mark.parametrize("name", ["n_rho", "n_psi", "n_beta", "n_own", "n_other"])
def test_an_axis_of_one_node_is_refused(name):
    with pytest.raises(TableError, match="at least 2 nodes"):
        replace(GRID, **{name: 1})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rho_last_m": 5.0}, "must obey"),
        ({"rho_last_m": float("nan")}, "must obey"),
        ({"rho_first_m": 0.0}, "must obey"),
        ({"cap_m": 1.0}, "must obey"),
        ({"own_top_mps": 0.0}, "top speeds"),
        ({"other_top_mps": float("nan")}, "top speeds"),
        ({"rho_ratio": 1.0}, "rho_ratio"),
    ],
)
def test_impossible_grids_are_refused(change, words):
    with pytest.raises(TableError, match=words):
        replace(GRID, **change)


def test_spacings():
    grid = Grid(10.0, 5, 12, 7, 3, 3, 2.0, 2.0)
    assert np.degrees([grid.psi_step_rad, grid.beta_step_rad]) == pytest.approx([30.0, 30.0])
    assert grid.size == 5 * 12 * 7 * 9
