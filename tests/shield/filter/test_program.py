"""The program through qpsolvers: only answers that satisfy every row by our own residuals count."""

import math
import time

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import SolverError
from steerclear.shield.filter.program import ROW_TOLERANCE, Program, check_solver, holds, solve

SOLVERS = sorted(qpsolvers.available_solvers)
GIVES_UP = {"proxqp": "takes a feasible program in some hundreds for infeasible; no answer is a safe one"}
quick = settings(max_examples=40, deadline=None, derandomize=True)


def program(seed=0, rows=8, n=4, room=0.1):
    random = np.random.default_rng(seed)
    C = random.normal(size=(rows, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    inside = 0.3 * random.normal(size=n)
    return Program(C, C @ inside - room * random.uniform(size=rows), random.normal(size=n))


def impossible(n=2):
    C = np.vstack([np.eye(n), -np.eye(n)])
    return Program(C, np.ones(2 * n), np.zeros(n))


@pytest.mark.parametrize("solver", SOLVERS)
@quick
@given(seed=st.integers(0, 10_000))
def test_every_backend_finds_the_same_answer(solver, seed):
    task = program(seed)
    answer, reference = solve(task, solver), solve(task, "quadprog")
    if answer is None and solver in GIVES_UP:
        return
    assert answer == pytest.approx(reference, rel=0, abs=1e-5)
    assert holds(task.C, task.d, answer, ROW_TOLERANCE)


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_backend_gives_up_often(solver):
    answers = [solve(program(seed), solver) for seed in range(100)]
    assert sum(answer is None for answer in answers) <= (2 if solver in GIVES_UP else 0)


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_backend_answers_an_infeasible_program(solver):
    assert solve(impossible(), solver) is None
    assert solve(impossible(8), solver) is None


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_backend_takes_long_over_an_infeasible_program(solver):
    """A team of six in a crowd, rows that contradict each other: milliseconds, not seconds."""
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
    assert not holds(C, d, np.zeros(2), 1e-4)
    assert not holds(np.eye(2), np.array([0.0, math.nan]), np.ones(2), 1e-4)
    assert not holds(np.eye(2), np.zeros(2), np.array([1.0, math.nan]), 1e-4)


@quick
@given(seed=st.integers(0, 10_000), factor=st.floats(1.5, 100.0))
def test_an_answer_short_of_a_row_does_not_hold(seed, factor):
    task = program(seed)
    answer = solve(task, "daqp")
    worst = np.argmin(task.C @ answer - task.d)
    short = answer - (task.C[worst] @ answer - task.d[worst] + factor * ROW_TOLERANCE) * task.C[worst]
    assert not holds(task.C, task.d, short, ROW_TOLERANCE)


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
FAILURES = [
    RuntimeError("boom"),
    ValueError("shape"),
    KeyError("x"),
    TypeError("type"),
    MemoryError(),
    IndexError(),
    ZeroDivisionError(),
    qpsolvers.exceptions.SolverError("gave up"),
]


@pytest.mark.parametrize("name", BAD_ANSWERS)
def test_an_answer_that_is_none_is_refused(name, monkeypatch):
    task = program(2, rows=10, room=0.0)
    good = solve(task, "quadprog")
    monkeypatch.setattr(qpsolvers, "solve_qp", lambda *args, **kwargs: BAD_ANSWERS[name](good.copy()))
    assert solve(task, "daqp") is None


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
def test_a_backend_that_raises_has_no_answer(failure, monkeypatch):
    def explode(*args, **kwargs):
        raise failure

    monkeypatch.setattr(qpsolvers, "solve_qp", explode)
    assert solve(program(), "daqp") is None


def test_an_interrupt_is_not_swallowed(monkeypatch):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(qpsolvers, "solve_qp", interrupt)
    with pytest.raises(KeyboardInterrupt):
        solve(program(), "daqp")


def test_a_good_answer_passes_the_same_way(monkeypatch):
    """So that the refusals above are due to the answers and not to the stand-in."""
    task = program(2)
    good = solve(task, "quadprog")
    monkeypatch.setattr(qpsolvers, "solve_qp", lambda *args, **kwargs: good.copy())
    assert solve(task, "daqp") == pytest.approx(good, abs=0)


@pytest.mark.parametrize("name", ["gurobbi", "", "DAQP", "scipy"])
def test_a_missing_backend_is_told_with_those_there_are(name):
    with pytest.raises(SolverError, match=r"not installed; choose one of .*daqp"):
        check_solver(name)
    with pytest.raises(SolverError, match=r"pip install"):
        ShieldConfig(solver=name)


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_backend_that_is_installed_can_be_chosen(solver):
    assert ShieldConfig(solver=solver).solver == solver
