"""The program: only answers that satisfy every row count; the compiled projection against a QP solver."""

import math
import time
from collections import Counter

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import ShieldConfig
from steerclear.shield.filter import program as backend
from steerclear.shield.filter.program import ROW_TOLERANCE, Program, solve
from steerclear.shield.filter.qp import project

SOLVERS = sorted(qpsolvers.available_solvers)

GIVES_UP = {"proxqp": "takes a feasible program in some hundreds for infeasible; no answer is a safe one"}


def program(seed=0, rows=8, n=4, room=0.1):
    random = np.random.default_rng(seed)
    C = random.normal(size=(rows, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    inside = 0.3 * random.normal(size=n)
    return Program(C, C @ inside - room * random.uniform(size=rows), random.normal(size=n))


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_backend_that_is_installed_finds_the_same_answer_and_seldom_gives_up(solver):
    assert ShieldConfig(solver=solver).solver == solver
    given_up = 0
    for seed in range(100):
        task = program(seed)
        answer, reference = solve(task, solver), solve(task, "quadprog")
        if answer is None:
            given_up += 1
            continue
        assert answer == pytest.approx(reference, rel=0, abs=1e-5)
        assert task.holds(answer)
    assert given_up <= (2 if solver in GIVES_UP else 0)


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_backend_answers_an_infeasible_program_nor_takes_long_over_it(solver):
    """A team of six in a crowd, rows that contradict each other: milliseconds, not seconds."""
    for n in (2, 8):
        assert solve(Program(np.vstack([np.eye(n), -np.eye(n)]), np.ones(2 * n), np.zeros(n)), solver) is None
    random = np.random.default_rng(3)
    C = random.normal(size=(150, 12))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    task = Program(np.vstack([C, -C]), np.full(300, 0.5), random.normal(size=12))
    solve(task, solver)
    started = time.process_time()
    assert solve(task, solver) is None
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("place", ["C", "d", "z0"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_nothing_that_is_no_number_is_solved(solver, place, value):
    """Left to itself proxqp takes half a minute over such a program, and others answer it."""
    task = program(1)
    getattr(task, place).flat[3] = value
    assert solve(task, solver) is None


def test_a_row_of_nan_holds_for_nobody():
    C, d = np.array([[1.0, 0.0], [math.nan, 0.0]]), np.array([0.0, -1e9])
    assert not Program(C, d, np.zeros(2)).holds(np.zeros(2))
    assert not Program(np.eye(2), np.array([0.0, math.nan]), np.zeros(2)).holds(np.ones(2))
    assert not Program(np.eye(2), np.zeros(2), np.zeros(2)).holds(np.array([1.0, math.nan]))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000), factor=st.floats(1.5, 100.0))
def test_an_answer_short_of_a_row_does_not_hold(seed, factor):
    task = program(seed)
    answer = solve(task, "daqp")
    worst = np.argmin(task.C @ answer - task.d)
    short = answer - (task.C[worst] @ answer - task.d[worst] + factor * ROW_TOLERANCE) * task.C[worst]
    assert not task.holds(short)


BAD_ANSWERS = {
    "nothing": lambda z: None,
    "nan": lambda z: np.full_like(z, np.nan),
    "one nan": lambda z: np.where(np.arange(len(z)) == 0, np.nan, z),
    "inf": lambda z: np.full_like(z, np.inf),
    "too short": lambda z: z[:-1],
    "too long": lambda z: np.append(z, 0.0),
    "a column": lambda z: z[:, None],
    "a list": lambda z: z.tolist(),
    "integers": lambda z: np.full(len(z), 10**6),
    "text": lambda z: "solved",
    "a number": lambda z: 0.0,
    "complex": lambda z: z.astype(complex),
    "garbage": lambda z: z + 1e3,
    "off by a little": lambda z: z - 0.01 * np.sign(z) - 0.01,
}


def test_an_answer_that_is_none_is_refused(monkeypatch):
    task = program(2, rows=10, room=0.0)
    good = solve(task, "quadprog")
    for make in BAD_ANSWERS.values():
        monkeypatch.setattr(qpsolvers, "solve_qp", lambda *_, make=make, **__: make(good.copy()))
        assert solve(task, "daqp") is None
    monkeypatch.setattr(qpsolvers, "solve_qp", lambda *_, **__: good.copy())
    assert solve(task, "daqp") == pytest.approx(good, abs=0), "the refusals are due to the answers"


def test_a_backend_that_raises_has_no_answer_and_an_interrupt_is_not_swallowed(monkeypatch):
    def explode(*_, **__):
        raise failure

    monkeypatch.setattr(qpsolvers, "solve_qp", explode)
    of_qp = qpsolvers.exceptions.SolverError("gave up")
    for kind in (RuntimeError, ValueError, KeyError, TypeError, MemoryError, IndexError, ZeroDivisionError, of_qp):
        failure = kind if kind is of_qp else kind("boom")
        assert solve(program(), "daqp") is None
    failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        solve(program(), "daqp")


def test_a_backend_that_fails_at_each_decision_is_logged_seldom_and_counted(monkeypatch, caplog):
    def explode(*_, **__):
        raise RuntimeError("boom")

    monkeypatch.setattr(qpsolvers, "solve_qp", explode)
    monkeypatch.setattr(backend, "_FAILURES", Counter())
    for _ in range(100):
        assert solve(program(), "daqp") is None
    assert len(caplog.records) == 7
    assert caplog.messages[-1] == "QP solver daqp failed (RuntimeError: boom), 64 times so far; backups stand in"


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
