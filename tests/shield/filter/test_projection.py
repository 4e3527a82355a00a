"""The compiled projection against a QP solver, and against what any projection must do."""

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.filter.qp import project

many = settings(max_examples=250, deadline=None, derandomize=True)


def run(C, d, z0):
    """Whether there is an answer, and the answer of the projection."""
    C = np.ascontiguousarray(C, dtype=float)
    z = np.full(C.shape[1], np.nan)
    return project(C, np.asarray(d, dtype=float), np.asarray(z0, dtype=float), z, np.zeros(len(C))), z


@st.composite
def programs(draw):
    """Unit rows, some twice or reversed, that hold round a known point, with limits of all inputs: as the shield's."""
    random = np.random.default_rng(draw(st.integers(0, 2**31)))
    n, rows = draw(st.sampled_from([2, 4, 6])), draw(st.integers(0, 8))
    C = random.normal(size=(rows, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    for r in range(1, rows):
        C[r] *= 1.0 if draw(st.booleans()) else -1.0
        C[r] = C[r - 1] if draw(st.integers(0, 5)) == 0 else C[r]
    inside = random.uniform(-0.8, 0.8, n)
    d = C @ inside - random.uniform(0.01, 1.0, rows)
    return np.vstack([C, np.eye(n), -np.eye(n)]), np.append(d, np.full(2 * n, -1.0)), random.uniform(-1.0, 1.0, n)


@many
@given(programs())
def test_it_is_the_nearest_point_that_keeps_all_rows(program):
    C, d, z0 = program
    found, z = run(C, d, z0)
    if not found:  # slow where rows are all but opposite: then the backups stand
        return
    assert (C @ z >= d - 1e-6).all()
    other = qpsolvers.solve_qp(np.eye(len(z0)), -z0, -C, -d, solver="quadprog")
    assert np.linalg.norm(z - z0) <= np.linalg.norm(other - z0) + 1e-4
    np.testing.assert_allclose(z, other, atol=1e-3)


def test_nearly_all_programs_have_an_answer():
    random, found = np.random.default_rng(3), 0
    for _ in range(300):
        C = random.normal(size=(6, 4))
        C /= np.linalg.norm(C, axis=1, keepdims=True)
        d = C @ random.uniform(-0.8, 0.8, 4) - random.uniform(0.01, 1.0, 6)
        rows, least = np.vstack([C, np.eye(4), -np.eye(4)]), np.append(d, np.full(8, -1.0))
        found += run(rows, least, random.uniform(-1.0, 1.0, 4))[0]
    assert found >= 285


@many
@given(programs())
def test_a_point_that_keeps_all_rows_is_its_own_answer(program):
    C, d, z0 = program
    found, z = run(C, np.minimum(d, C @ z0 - 1e-9), z0)
    assert found
    np.testing.assert_array_equal(z, z0)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_rows_that_are_no_numbers_have_no_answer(bad):
    for C, d in (([[bad, 0.0]], [0.0]), ([[1.0, 0.0]], [bad])):
        with np.errstate(all="ignore"):
            assert not run(C, d, [0.0, 0.0])[0]


def test_rows_that_exclude_each_other_have_no_answer():
    assert not run([[1.0, 0.0], [-1.0, 0.0]], [1.0, 1.0], [0.0, 0.0])[0]
