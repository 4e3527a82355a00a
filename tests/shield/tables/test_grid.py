"""The grid: ranges and their places, bad numbers of nodes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.exceptions import TableError
from steerclear.shield.tables.grid import rho_place
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
