"""A boat as a unicycle: its limits, commands to inputs and back; the program against a reference, its relaxation."""

import numpy as np
import pytest
from qpsolvers import solve_qp
from steerclear.experiments.baselines.unicycle import (
    RELAXED,
    SLACK_WEIGHT,
    SOLVED,
    UNSOLVED,
    command_of_inputs,
    input_limits,
    inputs_of_command,
    solve,
)
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import cruise


def read(platform, state, speed, relative):
    z, box = np.zeros(2), np.zeros((2, 2))
    limits = np.array(input_limits(platform, 0.1))
    most = inputs_of_command(platform.pack(), limits, state, np.array([speed, relative]), 0.1, z, box)
    return z, box, most


def write(platform, state, z, most):
    return command_of_inputs(platform.pack(), np.array(input_limits(platform, 0.1)), state, np.array(z), most, 0.1)


@pytest.mark.parametrize("name", ["heron", "surveyor", "si"])
@pytest.mark.parametrize("share", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_turn_asked_for_is_the_turn_made(name, share):
    platform = get_platform(name)
    params, state = cruise(platform)
    most = read(platform, state, platform.max_speed_mps, 0.0)[2]
    speed, relative = write(platform, state, [0.0, share], most)
    assert speed == pytest.approx(state[L.SPEED])
    z, _, again = read(platform, state, speed, relative)
    assert z[1] * again == pytest.approx(share * most, abs=1e-6)
    assert z[0] == pytest.approx(0.0, abs=1e-9)
    before = state[L.HEADING]
    step_boat(params, state, speed, relative, 0.1)
    turned_deg = (state[L.HEADING] - before + 180.0) % 360.0 - 180.0
    assert np.radians(turned_deg) / 0.1 == pytest.approx(z[1] * again)


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


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_a_number_is_never_solved(bad):
    C, d, hard, z0 = random_program(4)
    d[hard] = bad
    status, z, _ = run(C, d, hard, z0)
    assert status == UNSOLVED
    np.testing.assert_array_equal(z, z0)
