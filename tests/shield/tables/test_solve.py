"""The solver: an independent dynamic program, closed forms, monotony, threads, interruption."""

import itertools
import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from steerclear.shield.exceptions import TableError
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import advance_hull
from steerclear.shield.tables.files import pack_values
from steerclear.shield.tables.grid import Grid
from steerclear.shield.tables.lookup import LEVELS_S, pack
from steerclear.shield.tables.moves import sub_steps
from steerclear.shield.tables.settings import RUDDERS, OtherMay, Problem
from steerclear.shield.tables.solve import solve
from table_scenes import problem, steady_car


def drive(platform, speed, rudder, steps):
    """Positions, heading (rad) and speed of a hull from the origin at full thrust, in the world's frame."""
    state = np.zeros(L.N_STATE)
    state[L.SPEED], state[L.THRUST], state[L.RUDDER] = speed, platform.max_thrust, 100.0 * rudder
    params, trail = platform.pack(), [(0.0, 0.0)]
    for _ in range(steps):
        advance_hull(params, state, 0.1)
        trail.append((state[L.X], state[L.Y]))
    return np.array(trail), math.radians(state[L.HEADING]), state[L.SPEED]


def dynamic_program(one, values, count):
    """Values by plain backward induction with NumPy and SciPy; closest approaches by samples every 0.02 s."""
    grid, steps = one.grid, sub_steps(one.dt_s)
    ranges, psis = grid.ranges_m(), np.arange(grid.n_psi) * grid.psi_step_rad
    betas, own_v, other_v = np.arange(grid.n_beta) * grid.beta_step_rad, grid.own_speeds_mps(), grid.other_speeds_mps()
    runs = {
        (role, i, r): drive(boat, speed, r, steps)
        for role, boat, speeds in (("own", one.own, own_v), ("other", one.other, other_v))
        for i, speed in enumerate(speeds)
        for r in RUDDERS
    }
    axes = (ranges, np.append(psis, 2.0 * np.pi), betas, own_v, other_v)
    rho, psi, beta = np.meshgrid(ranges, psis, betas, indexing="ij")
    fine, coarse = np.linspace(0.0, steps, 5 * steps + 1), np.arange(steps + 1)

    def after(look, a, b, r, s):
        """Smaller of the closest approach within the step and the value behind it, for all ranges and angles."""
        (trail, turn, speed), (their_trail, their_turn, their_speed) = runs["own", a, r], runs["other", b, s]
        ours, theirs = (np.stack([np.interp(fine, coarse, t[:, i]) for i in (0, 1)]) for t in (trail, their_trail))
        east = (rho * np.sin(beta))[..., None] + np.cos(psi)[..., None] * theirs[0] + np.sin(psi)[..., None] * theirs[1]
        north = (
            (rho * np.cos(beta))[..., None] - np.sin(psi)[..., None] * theirs[0] + np.cos(psi)[..., None] * theirs[1]
        )
        distance = np.hypot(east - ours[0], north - ours[1])
        bearing = np.arctan2(east[..., -1] - ours[0, -1], north[..., -1] - ours[1, -1]) - turn
        bearing = np.angle(np.exp(1j * bearing))
        heading = np.where(bearing < 0.0, -1.0, 1.0) * (psi + their_turn - turn) % (2.0 * np.pi)
        last = distance[..., -1]
        flat = [np.clip(last, ranges[0], ranges[-1]), heading, np.abs(bearing), np.full_like(psi, speed)]
        later = look(np.stack([*flat, np.full_like(psi, their_speed)], axis=-1))
        return np.minimum(distance.min(axis=-1), np.where(last < ranges[0], last, later))

    for _ in range(count):
        look = RegularGridInterpolator(axes, np.concatenate([values, values[:, :1]], axis=1))
        new = values.copy()
        for a, b in itertools.product(range(len(own_v)), range(len(other_v))):
            table = np.array([[after(look, a, b, r, s) for s in RUDDERS] for r in RUDDERS])
            answer = table.max(axis=1) if one.other_may is OtherMay.COOPERATIVE else table.min(axis=1)
            new[..., a, b] = np.minimum(values[..., a, b], answer.max(axis=0))
        values = new
    return values


def distances(one):
    """Values before any play."""
    ranges = np.minimum(one.grid.ranges_m(), one.grid.cap_m)
    return np.broadcast_to(ranges[:, None, None, None, None], one.grid.shape)


@pytest.mark.parametrize("mode", ["worst-case", "cooperative"])
def test_values_are_those_of_a_plain_dynamic_program(mode):
    one = problem(mode)
    state = solve(one, threads=2)
    ours = state.values.reshape(one.grid.shape)
    theirs = dynamic_program(one, distances(one), state.iterations)
    # the plain one samples closest approaches every 0.02 s of 4 m/s
    assert np.abs(ours - theirs).max() < 0.05
    assert np.abs(ours - theirs).mean() < 2e-3
    assert (theirs < distances(one) - 0.5).mean() > 0.02


@pytest.mark.parametrize("mode", ["worst-case", "cooperative"])
def test_values_of_unlike_boats_stay_as_they_are_in_a_plain_step(mode):
    one = problem(mode, own="surveyor", other="heron", dt_s=0.5, horizon_s=16.0)
    state = solve(one, threads=2)
    ours = state.values.reshape(one.grid.shape)
    assert np.abs(dynamic_program(one, ours, 1) - ours).max() < state.residual_m + 2e-3


def straight(closing, **nodes):
    """Two boats that cannot turn, and a grid fine in range and bearing, at one speed pair."""
    cars = steady_car("own", closing / 2.0), steady_car("other", closing / 2.0)
    grid = Grid(
        20.0,
        **({"n_rho": 60, "n_psi": 4, "n_beta": 73} | nodes),
        n_own=2,
        n_other=2,
        own_top_mps=closing / 2.0,
        other_top_mps=closing / 2.0,
    )
    return Problem(*cars, OtherMay.WORST_CASE, grid, 0.5, 10.0)


def test_boats_that_cannot_turn_pass_as_geometry_says():
    one = straight(4.0)
    values = solve(one, threads=2).values.reshape(one.grid.shape)[:, 2, :, -1, -1]  # head-on
    rho, beta = np.meshgrid(one.grid.ranges_m(), np.arange(73) * one.grid.beta_step_rad, indexing="ij")
    x, y = rho * np.sin(beta), rho * np.cos(beta)
    exact = np.minimum(np.where(y > 0.0, np.abs(x), rho), 6.0)
    near = (rho > 2.0) & (rho < 12.0) & (exact > 1.0)
    error = np.abs(values - exact)[near]
    assert error.mean() < 0.08
    assert error.max() < 0.6  # where the passing side changes the value has a kink


def test_threads_change_nothing():
    one, three = (solve(problem(), threads=count).values for count in (1, 3))
    np.testing.assert_array_equal(one, three)


def interrupt_after(steps):
    def notice(done, total, residual_m):
        if done == steps:
            raise KeyboardInterrupt

    return notice


@pytest.mark.parametrize("steps", [1, 3])
def test_an_interrupted_solve_goes_on_to_the_same_values(tmp_path, steps):
    whole, kept = solve(problem(), threads=2), tmp_path / "deep" / "kept"
    with pytest.raises(KeyboardInterrupt):
        solve(problem(), threads=2, checkpoint=kept, notice=interrupt_after(steps))
    seen = []
    resumed = solve(problem(), threads=1, checkpoint=kept, notice=lambda done, total, change: seen.append(done))
    assert seen[0] == steps + 1
    np.testing.assert_array_equal(resumed.values, whole.values)
    np.testing.assert_array_equal(resumed.levels, whole.levels)
    assert (resumed.iterations, resumed.residual_m) == (whole.iterations, whole.residual_m)


def test_shorter_times_are_passed_on_the_way_and_tell_of_no_less():
    """V(x, T) of a longer solve is the value a solve to that time ends with."""
    boats = {"own": "surveyor", "other": "surveyor", "dt_s": 1.0, "rho_last_m": 40.0}
    short, long = (solve(problem(horizon_s=time_s, **boats), threads=2) for time_s in LEVELS_S[:2])
    assert len(long.levels) == 2
    np.testing.assert_array_equal(long.levels[0], pack(short.values, 6.0))
    np.testing.assert_array_equal(long.levels[1], pack(long.values, 6.0))
    table = pack_values(problem(**boats), long)
    assert table.card.levels_s == LEVELS_S
    assert (table.levels[:-1] >= table.levels[1:]).all()
    assert (table.levels[-1] == table.values).all()
    assert (table.levels[0] > table.values).any()


def test_checkpoints_of_other_problems_and_damaged_ones_are_refused(tmp_path):
    kept = tmp_path / "kept"
    solve(problem(horizon_s=0.3), threads=1, checkpoint=kept)
    with pytest.raises(TableError, match=r"another problem; delete it or name another with --checkpoint"):
        solve(problem(), checkpoint=kept)
    kept.write_bytes(kept.read_bytes()[:300])
    with pytest.raises(TableError, match=r"cannot be read .* delete it to start afresh"):
        solve(problem(), checkpoint=kept)
    with pytest.raises(TableError, match=r"cannot be written .* name another with --checkpoint"):
        solve(problem(horizon_s=0.3), threads=1, checkpoint=tmp_path / "kept" / "inside")
