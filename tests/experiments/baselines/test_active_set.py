"""The compiled projection against two QP solvers, and against what any projection must do."""

import numpy as np
import pytest
import qpsolvers
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.experiments.baselines.active_set import INFEASIBLE, OPTIMAL, STALLED, project

many = settings(max_examples=250, deadline=None, derandomize=True)
SLACK = 1e-6


def run(C, d, z0):
    """Status and answer of the projection."""
    C = np.ascontiguousarray(C, dtype=float)
    z = np.full(C.shape[1], np.nan)
    status = project(C, np.asarray(d, dtype=float), np.asarray(z0, dtype=float), z)
    return status, z


def reference(C, d, z0, solver):
    options = {"daqp": {"primal_tol": 1e-12, "dual_tol": 1e-12}, "quadprog": {}}[solver]
    return qpsolvers.solve_qp(np.eye(len(z0)), -np.asarray(z0), -C, -np.asarray(d), solver=solver, **options)


def unit_rows(random, rows, n):
    C = random.normal(size=(rows, n))
    return C / np.linalg.norm(C, axis=1, keepdims=True)


@st.composite
def programs(draw, feasible=True):
    """Unit rows, some of them twice, nearly twice or reversed; ``feasible`` ones hold round a known point."""
    random = np.random.default_rng(draw(st.integers(0, 2**31)))
    n, rows = draw(st.integers(1, 8)), draw(st.integers(0, 14))
    C = unit_rows(random, rows, n)
    for r in range(1, rows):
        kind = draw(st.sampled_from(["own", "own", "own", "twice", "nearly", "reversed"]))
        if kind == "twice":
            C[r] = C[r - 1]
        elif kind == "nearly":
            C[r] = C[r - 1] + 1e-9 * random.normal(size=n)
        elif kind == "reversed":
            C[r] = -C[r - 1]
    d = random.normal(size=rows)
    if feasible:
        inside = random.normal(size=n)
        d = np.minimum(d, C @ inside - draw(st.sampled_from([1e-4, 1e-2, 1.0])))
    return C, d, 3.0 * random.normal(size=n)


@pytest.mark.parametrize("solver", ["daqp", "quadprog"])
@settings(max_examples=120, deadline=None, derandomize=True)
@given(program=programs())
def test_agrees_with_other_solvers(solver, program):
    C, d, z0 = program
    assume(len(C))
    status, z = run(C, d, z0)
    other = reference(C, d, z0, solver)
    assume(other is not None and (C @ other >= d - 1e-8).all())  # they give up on some nearly parallel rows
    assert status == OPTIMAL
    assert z == pytest.approx(other, rel=0, abs=2e-6)


@many
@given(programs(feasible=False))
def test_infeasible_programs_are_told(program):
    """Whatever is claimed is checked by linear programming, which knows nothing of projections."""
    from scipy.optimize import linprog

    C, d, z0 = program
    assume(len(C))
    status, z = run(C, d, z0)
    n = C.shape[1]
    # largest s with C z >= d + s: feasible exactly when it is >= 0
    best = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.column_stack([-C, np.ones(len(C))]),
        b_ub=-d,
        bounds=[(-1e3, 1e3)] * n + [(None, 10.0)],
    )
    room = -best.fun
    assume(abs(room) > 1e-6)
    assert status == (OPTIMAL if room > 0 else INFEASIBLE)
    assert status != OPTIMAL or (C @ z >= d - SLACK).all()


@pytest.mark.parametrize("place", ["C", "d", "z0"])
def test_nan_is_never_taken_for_a_row_that_holds(place):
    C, d, z0 = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([0.5, 0.5]), np.zeros(2)
    {"C": C, "d": d, "z0": z0}[place][0] = np.nan
    assert run(C, d, z0)[0] == STALLED
