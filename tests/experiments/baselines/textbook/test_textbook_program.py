"""The filters' program against a reference solver, and its relaxation."""

import numpy as np
import pytest
from qpsolvers import solve_qp
from steerclear.experiments.baselines.textbook.program import RELAXED, SLACK_WEIGHT, SOLVED, UNSOLVED, solve


def random_program(seed, soft=4, boats=2):
    """Box limits about 0 and unit rows at random."""
    random = np.random.default_rng(seed)
    n = 2 * boats
    box = np.concatenate([np.eye(n), -np.eye(n)])
    rows = random.normal(size=(soft, n))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    C = np.concatenate([box, rows])
    d = np.concatenate([-np.ones(2 * n), random.uniform(-0.5, 1.0, soft)])
    return C, d, 2 * n, random.uniform(-1.0, 1.0, n)


def run(C, d, hard, z0):
    z, slack = np.zeros(len(z0)), np.zeros(len(d) - hard)
    return solve(C, d, hard, z0, z, slack), z, slack


def relaxed_reference(C, d, hard, z0):
    n, soft = len(z0), len(d) - hard
    P = np.diag([1.0] * n + [SLACK_WEIGHT] * soft)
    q = -np.concatenate([z0, np.zeros(soft)])
    wide = np.zeros((len(d), n + soft))
    wide[:, :n], wide[hard:, n:] = C, np.eye(soft)
    return solve_qp(P, q, -wide, -d, solver="quadprog")


def test_answers_are_those_of_a_reference_solver():
    statuses = []
    for seed in range(80):
        C, d, hard, z0 = random_program(seed)
        status, z, slack = run(C, d, hard, z0)
        reference = solve_qp(np.eye(len(z0)), -z0, -C, -d, solver="quadprog")
        statuses.append(status)
        if reference is not None:
            assert status == SOLVED
            assert (slack == 0.0).all()
            np.testing.assert_allclose(z, reference, atol=1e-7)
        else:
            assert status == RELAXED
            wide = relaxed_reference(C, d, hard, z0)
            np.testing.assert_allclose(z, wide[: len(z0)], atol=1e-4)
            np.testing.assert_allclose(slack, wide[len(z0) :], atol=1e-5)
    assert {SOLVED, RELAXED} == set(statuses)


def test_limits_hold_when_rows_do_not():
    C, d, hard, z0 = random_program(3)
    d[hard:] = 9.0
    status, z, slack = run(C, d, hard, z0)
    assert status == RELAXED
    assert (np.abs(z) <= 1.0 + 1e-7).all()
    assert (C[hard:] @ z + slack >= d[hard:] - 1e-7).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_a_number_is_never_solved(bad):
    C, d, hard, z0 = random_program(4)
    d[hard] = bad
    status, z, _ = run(C, d, hard, z0)
    assert status == UNSOLVED
    np.testing.assert_array_equal(z, z0)
