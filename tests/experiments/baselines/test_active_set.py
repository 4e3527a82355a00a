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


def multipliers_exist(C, d, z, z0):
    """Whether z - z0 is a non-negative combination of the rows that bind (non-negative least squares)."""
    from scipy.optimize import nnls

    binding = np.abs(C @ z - d) <= 1e-7
    if not binding.any():
        return np.linalg.norm(z - z0) <= 1e-9
    _, rest = nnls(C[binding].T, z - z0)
    return rest <= 1e-6 * (1.0 + np.linalg.norm(z - z0))


@many
@given(programs())
def test_feasible_programs_are_solved_to_optimality(program):
    C, d, z0 = program
    status, z = run(C, d, z0)
    assert status == OPTIMAL
    assert (C @ z >= d - SLACK).all()
    assert multipliers_exist(C, d, z, z0)


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


def test_opposite_rows_that_leave_no_room_are_infeasible():
    status, _ = run([[1.0, 0.0], [-1.0, 0.0]], [1.0, 1.0], [0.0, 0.0])
    assert status == INFEASIBLE


def test_opposite_rows_that_leave_one_line_are_met():
    status, z = run([[1.0, 0.0], [-1.0, 0.0]], [1.0, -1.0], [0.0, 2.0])
    assert status == OPTIMAL
    assert z == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize("n", [1, 2, 5])
def test_no_rows_leave_the_wanted_point_bit_for_bit(n):
    z0 = np.arange(n) * 0.1 - 0.2
    status, z = run(np.zeros((0, n)), [], z0)
    assert status == OPTIMAL
    assert z.tobytes() == z0.tobytes()


@many
@given(programs(), st.floats(0.0, 5.0), st.integers(0, 2**31))
def test_a_satisfied_row_changes_nothing(program, room, seed):
    C, d, z0 = program
    status, z = run(C, d, z0)
    assert status == OPTIMAL
    row = unit_rows(np.random.default_rng(seed), 1, C.shape[1])
    more, limit = np.vstack([C, row]), np.append(d, row @ z - room)
    status, again = run(more, limit, z0)
    assert status == OPTIMAL
    assert again == pytest.approx(z, rel=0, abs=1e-7)


@many
@given(programs(feasible=False), st.integers(0, 2**31), st.floats(-2.0, 2.0))
def test_no_further_row_ever_loosens_a_program(program, seed, limit):
    C, d, z0 = program
    row = unit_rows(np.random.default_rng(seed), 1, C.shape[1])
    few, z = run(C, d, z0)
    many_, tighter = run(np.vstack([C, row]), np.append(d, limit), z0)
    if few == INFEASIBLE:
        assert many_ == INFEASIBLE
    elif many_ == OPTIMAL:
        cost, tight_cost = np.sum((z - z0) ** 2), np.sum((tighter - z0) ** 2)
        assert tight_cost >= cost - 1e-6 * (1.0 + cost)


@many
@given(programs(), st.integers(0, 2**31))
def test_the_order_of_rows_does_not_matter(program, seed):
    C, d, z0 = program
    order = np.random.default_rng(seed).permutation(len(C))
    _, z = run(C, d, z0)
    _, other = run(C[order], d[order], z0)
    assert other == pytest.approx(z, rel=0, abs=1e-6)


@many
@given(programs())
def test_projecting_twice_stays(program):
    C, d, z0 = program
    _, z = run(C, d, z0)
    _, again = run(C, d, z)
    assert again == pytest.approx(z, rel=0, abs=1e-7)


@pytest.mark.parametrize("place", ["C", "d", "z0"])
def test_nan_is_never_taken_for_a_row_that_holds(place):
    C, d, z0 = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([0.5, 0.5]), np.zeros(2)
    {"C": C, "d": d, "z0": z0}[place][0] = np.nan
    assert run(C, d, z0)[0] == STALLED


def test_a_hard_case_ends_soon():
    """Many nearly parallel rows round a corner: iterations are bounded, whatever comes of it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    C = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert run(C, np.full(400, 1e-3), np.array([5.0, 3.0]))[0] == INFEASIBLE
    status, z = run(C, np.full(400, -1.0), np.array([50.0, 30.0]))
    assert status == OPTIMAL
    assert np.linalg.norm(z) == pytest.approx(1.0, abs=1e-3)
