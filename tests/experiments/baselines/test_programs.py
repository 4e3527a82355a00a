"""What filters of the literature are made of: barriers, the compiled projection, the relaxed program, the unicycle."""

import math

import numpy as np
import pytest
import qpsolvers
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.experiments.baselines.active_set import INFEASIBLE, OPTIMAL, STALLED, project
from steerclear.experiments.baselines.barriers import collision_cone, exponential_cbf, parabolic, velocity_cbf
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

RADIUS_M = 2.5
A1_PER_S, K_LAMBDA_PER_M, K_MU_PER_S = 0.7, 0.2, 0.15
UNIT = math.sqrt(1.05**2 - 1.0) / RADIUS_M
GAINS = {
    velocity_cbf: (),
    exponential_cbf: (A1_PER_S,),
    collision_cone: (),
    parabolic: (K_LAMBDA_PER_M / UNIT, K_MU_PER_S / UNIT),
}
ALL = pytest.mark.parametrize("barrier", list(GAINS), ids=lambda barrier: barrier.__name__)
metres = st.floats(-30.0, 30.0)
speeds = st.floats(-5.0, 5.0)


def jet(barrier, point):
    h, h_p, h_v = barrier(np.array(point[:2]), np.array(point[2:]), RADIUS_M, *GAINS[barrier])
    return np.array([h, *h_p, *h_v])


@ALL
@settings(max_examples=150, deadline=None)
@given(px=metres, py=metres, vx=speeds, vy=speeds)
def test_gradients_are_those_of_h(barrier, px, py, vx, vy):
    assume(abs(math.hypot(px, py) - RADIUS_M) > 0.1)
    assume(math.hypot(px, py) > 0.3 and math.hypot(vx, vy) > 0.1)
    point, step = np.array([px, py, vx, vy]), 1e-6
    differences = [
        (jet(barrier, point + step * axis)[0] - jet(barrier, point - step * axis)[0]) / (2 * step) for axis in np.eye(4)
    ]
    if barrier is velocity_cbf:  # there the inputs act on p itself
        differences[2:] = differences[:2]
    np.testing.assert_allclose(jet(barrier, point)[1:], differences, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize(("miss_m", "safe"), [(2.4, False), (2.6, True)])
def test_collision_cone_tells_a_miss_from_a_hit(miss_m, safe):
    """A straight course that passes at a distance below the radius is unsafe however far off, one above is safe."""
    for away in (5.0, 50.0):
        assert (jet(collision_cone, (away, miss_m, -2.0, 0.0))[0] > 0.0) == safe


@ALL
@pytest.mark.parametrize("point", [(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (RADIUS_M, 0.0, 0.0, 0.0)])
def test_singular_places_give_numbers(barrier, point):
    assert np.isfinite(jet(barrier, point)).all()


def run(C, d, z0):
    """Status and answer of the projection."""
    C = np.ascontiguousarray(C, dtype=float)
    z = np.full(C.shape[1], np.nan)
    return project(C, np.asarray(d, dtype=float), np.asarray(z0, dtype=float), z), z


@st.composite
def programs(draw, feasible=True):
    """Unit rows, some of them twice, nearly twice or reversed; ``feasible`` ones hold round a known point."""
    random = np.random.default_rng(draw(st.integers(0, 2**31)))
    n, rows = draw(st.integers(1, 8)), draw(st.integers(1, 14))
    C = random.normal(size=(rows, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    for r in range(1, rows):
        kind = draw(st.sampled_from(["own", "own", "own", "twice", "nearly", "reversed"]))
        if kind != "own":
            C[r] = (-1.0 if kind == "reversed" else 1.0) * C[r - 1] + (kind == "nearly") * 1e-9 * random.normal(size=n)
    d = random.normal(size=rows)
    if feasible:
        d = np.minimum(d, C @ random.normal(size=n) - draw(st.sampled_from([1e-4, 1e-2, 1.0])))
    return C, d, 3.0 * random.normal(size=n)


@pytest.mark.parametrize("solver", ["daqp", "quadprog"])
@settings(max_examples=120, deadline=None, derandomize=True)
@given(program=programs())
def test_the_projection_agrees_with_other_solvers(solver, program):
    C, d, z0 = program
    status, z = run(C, d, z0)
    assert status == OPTIMAL
    assert (C @ z >= d - 1e-6).all()
    options = {"daqp": {"primal_tol": 1e-12, "dual_tol": 1e-12}, "quadprog": {}}[solver]
    other = qpsolvers.solve_qp(np.eye(len(z0)), -z0, -C, -d, solver=solver, **options)
    assume(other is not None and (C @ other >= d - 1e-8).all())  # they give up on some nearly parallel rows
    assert z == pytest.approx(other, rel=0, abs=2e-6)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(programs(feasible=False))
def test_infeasible_programs_are_told(program):
    """Whatever is claimed is checked by linear programming, which knows nothing of projections."""
    from scipy.optimize import linprog

    C, d, z0 = program
    status, z = run(C, d, z0)
    n = C.shape[1]
    # largest s with C z >= d + s: feasible exactly when it is >= 0
    wide, bounds = np.column_stack([-C, np.ones(len(C))]), [(-1e3, 1e3)] * n + [(None, 10.0)]
    room = -linprog(np.append(np.zeros(n), -1.0), A_ub=wide, b_ub=-d, bounds=bounds).fun
    assume(abs(room) > 1e-6)
    assert status == (OPTIMAL if room > 0 else INFEASIBLE)
    assert status != OPTIMAL or (C @ z >= d - 1e-6).all()


@pytest.mark.parametrize("place", ["C", "d", "z0"])
def test_nan_is_never_taken_for_a_row_that_holds(place):
    C, d, z0 = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([0.5, 0.5]), np.zeros(2)
    {"C": C, "d": d, "z0": z0}[place][0] = np.nan
    assert run(C, d, z0)[0] == STALLED


def random_program(seed, soft=4, n=4):
    """Box limits about 0 and unit rows at random."""
    random = np.random.default_rng(seed)
    rows = random.normal(size=(soft, n))
    C = np.concatenate([np.eye(n), -np.eye(n), rows / np.linalg.norm(rows, axis=1)[:, None]])
    return C, np.concatenate([-np.ones(2 * n), random.uniform(-0.5, 1.0, soft)]), 2 * n, random.uniform(-1.0, 1.0, n)


def test_the_relaxed_program_is_that_of_a_reference_solver():
    statuses = []
    for seed in range(80):
        C, d, hard, z0 = random_program(seed)
        n, soft, z = len(z0), len(d) - hard, np.zeros(len(z0))
        slack = np.zeros(soft)
        statuses.append(solve(C, d, hard, z0, z, slack))
        reference = qpsolvers.solve_qp(np.eye(n), -z0, -C, -d, solver="quadprog")
        assert statuses[-1] == (RELAXED if reference is None else SOLVED)
        if reference is None:
            wide = np.zeros((len(d), n + soft))
            wide[:, :n], wide[hard:, n:] = C, np.eye(soft)
            P, q = np.diag([1.0] * n + [SLACK_WEIGHT] * soft), -np.concatenate([z0, np.zeros(soft)])
            reference = qpsolvers.solve_qp(P, q, -wide, -d, solver="quadprog")
            np.testing.assert_allclose(slack, reference[n:], atol=1e-5)
        np.testing.assert_allclose(z, reference[:n], atol=1e-4 if statuses[-1] == RELAXED else 1e-7)
    assert {SOLVED, RELAXED} == set(statuses)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_a_number_is_never_solved(bad):
    C, d, hard, z0 = random_program(4)
    d[hard], z = bad, np.zeros(len(z0))
    assert solve(C, d, hard, z0, z, np.zeros(len(d) - hard)) == UNSOLVED
    np.testing.assert_array_equal(z, z0)


@pytest.mark.parametrize("name", ["heron", "surveyor", "si"])
@pytest.mark.parametrize("share", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_turn_asked_for_is_the_turn_made(name, share):
    platform = get_platform(name)
    (params, state), limits = cruise(platform), np.array(input_limits(platform, 0.1))
    z, box = np.zeros(2), np.zeros((2, 2))
    most = inputs_of_command(params, limits, state, np.array([platform.max_speed_mps, 0.0]), 0.1, z, box)
    command = command_of_inputs(params, limits, state, np.array([0.0, share]), most, 0.1)
    assert command[0] == pytest.approx(state[L.SPEED])
    again = inputs_of_command(params, limits, state, np.array(command), 0.1, z, box)
    assert z[1] * again == pytest.approx(share * most, abs=1e-6)
    assert z[0] == pytest.approx(0.0, abs=1e-9)
    before = state[L.HEADING]
    step_boat(params, state, *command, 0.1)
    turned_deg = (state[L.HEADING] - before + 180.0) % 360.0 - 180.0
    assert np.radians(turned_deg) / 0.1 == pytest.approx(z[1] * again)
