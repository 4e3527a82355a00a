"""The QP among teammates: the command nearest to the nominal one with which boats satisfy what their backups satisfy.

    minimise 1/2 |z - z0|^2   subject to   C z >= d

Scaled inputs of boat i: z_t = turn / full turn of this step (deg), z_s = sqrt(speed_weight) * speed / top speed. With
manoeuvre and closest point fixed (envelope theorem), turning a boat by d(psi) in this step rotates its whole path about
its next position, and d(v) stretches it. Let n be the unit vector from neighbour to boat at the closest point, and r
the boat's path from its next position to there. Then

    dh/dpsi = n . (r_y, -r_x)   (psi clockwise),     dh/dv = n . r / v,

and a row is the discrete-time CBF condition h(x+) >= target, linearised about the candidate command. The target is the
margin required by the class-K rate, or that of the backups if it is larger:

    h + dh/dpsi_i (psi_i - psi_i') + dh/dv_i (v_i - v_i') >= target,

less the same terms of a teammate j, for whom n points the other way. The QP is only for own boats that no opponent
blocks, see `backup_switch`. An answer is sent only after the exact check.
"""

from __future__ import annotations

import math

from ..barriers.boats import clear_of_boat, required_margin_m
from ..barriers.clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE
from ..barriers.registered import write_slope
from ..barriers.static import about, clear_of_near_obstacles, clear_of_static
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn, full_turn
from ..platforms.step import step_boat
from ..workspace import BY_QP, LEAST_CHANGE, ROW_COST, STOPPED, Scene, all_spent
from .backup_switch import list_movers
from .blend import LITTLE_M, SCORE, before_opponent, keeps_backup_scores, note_verified, restore_verified, satisfies_all
from .nominal import predict_and_score
from .program import call_solver

STATIC_AIM_M = 1e-3
"""Rows of static constraints aim this much beyond the target, so that the exact check does not fail by rounding."""
SLOW_MPS = 0.3
"""Below this speed dh/dv is taken as at this speed."""
ROUNDS = 2
"""Rounds of linearising and solving before the backups are sent."""
SAME = 1e-6
"""Scaled input change below which a command counts as unchanged and the nominal one is sent."""
SWEEPS = 200
"""Passes over the rows after which a QP counts as infeasible."""
STILL, HOLDS = 1e-9, 1e-6
"""Change of multipliers below which a pass is the last, and the largest violation of a row then."""


@lean_kernel
def _dot(a: Array, b: Array) -> float:
    """Return the inner product; rows may be slices of a wider array, for which numpy's is slow."""
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * b[k]
    return total


@lean_kernel
def project(C: Array, d: Array, z0: Array, z: Array, dual: Array) -> bool:
    """Find the nearest point to ``z0`` with ``C z >= d``, by Hildreth's method (1957): row by row, until none moves it.

    Args:
        C: (rows, n), rows of unit length.
        d: (rows,).
        z0: (n,).
        z: (n,), the solution.
        dual: (rows,), its multipliers.

    Returns:
        Whether there is a solution; False also if a row is not finite.
    """
    copy_row(z, z0)
    dual[:] = 0.0
    for _ in range(SWEEPS):
        most = 0.0
        for r in range(d.shape[0]):
            step = max(-dual[r], d[r] - _dot(C[r], z))
            dual[r] += step
            most = max(most, abs(step))
            for c in range(z.shape[0]):
                z[c] += step * C[r, c]
        if most < STILL:
            break
    holds = True
    for r in range(d.shape[0]):
        holds = holds and d[r] - _dot(C[r], z) < HOLDS
    return holds


@lean_kernel
def _speed_effect(i: int, scene: Scene) -> float:
    """Return the change of the next speed, m/s, per m/s of speed command, by a step of the model."""
    params, command = scene.boats.params[i], scene.command[i]
    step = 0.1 * params[L.MAX_SPEED]
    if command[0] > 0.5 * params[L.MAX_SPEED]:
        step = -step
    copy_row(scene.row, scene.state[i])
    step_boat(params, scene.row, command[0] + step, command[1], scene.tuning.dt_s)
    return (scene.row[L.SPEED] - scene.next_state[i, L.SPEED]) / step


@lean_kernel
def _inputs_of(count: int, scene: Scene) -> None:
    """Find the scaled inputs of candidate (``scene.z_now``) and nominal commands (``scene.z0``), and the movers' gains.

    ``scene.gain[i]`` holds d(psi)/d(z_t) in rad, d(v)/d(z_s) in m/s, and the full turn, deg.
    """
    state, root, gain = scene.state, math.sqrt(scene.tuning.speed_weight), scene.gain
    for m in range(count):
        i = scene.movers[m]
        params, speed_mps = scene.boats.params[i], scene.command[i, 0]
        top, full = params[L.MAX_SPEED], max(full_turn(params, state[i], speed_mps, scene.tuning.dt_s), 1e-6)
        gain[i, 0], gain[i, 1], gain[i, 2] = math.radians(full), _speed_effect(i, scene) * top / root, full
        turn = (scene.next_state[i, L.HEADING] - state[i, L.HEADING] + 180.0) % 360.0 - 180.0
        scene.z_now[2 * m] = max(-1.0, min(1.0, turn / full))
        scene.z_now[2 * m + 1] = root * max(0.0, min(1.0, speed_mps / top))
        scene.z0[2 * m] = max(-1.0, min(1.0, scene.checked_turn[i] / full))
        scene.z0[2 * m + 1] = root * max(0.0, min(1.0, scene.checked[i, 0] / top))


@lean_kernel
def _add_effect(r: int, i: int, m: int, sign: float, scene: Scene) -> None:
    """Add boat i's share (mover m) of the clearance in ``scene.out`` to row r."""
    path, at, nx, ny = scene.path[i], scene.out[SAMPLE], scene.out[NORMAL_X], scene.out[NORMAL_Y]
    k = min(int(at), path.shape[0] - 2)
    part = min(1.0, at - k)
    x, y = path[k, 0], path[k, 1]
    if part > 0.0:  # the path ends at its last sample
        x += part * (path[k + 1, 0] - x)
        y += part * (path[k + 1, 1] - y)
    rx, ry = x - scene.next_state[i, L.X], y - scene.next_state[i, L.Y]
    scene.C[r, 2 * m] += sign * (nx * ry - ny * rx) * scene.gain[i, 0]
    speed = max(scene.next_state[i, L.SPEED], SLOW_MPS)
    scene.C[r, 2 * m + 1] += sign * (nx * rx + ny * ry) / speed * scene.gain[i, 1]


@lean_kernel
def _close_row(r: int, lack: float, count: int, scene: Scene) -> int:
    """Set the right-hand side so that the row reads h + C (z - z_now) >= target; scale to unit length.

    Returns the number of the next row: the same if no inputs can violate the row, or none affects it.
    """
    row, root, most = scene.C[r, : 2 * count], math.sqrt(scene.tuning.speed_weight), 0.0
    for c in range(0, 2 * count, 2):
        most += 2.0 * abs(row[c]) + root * abs(row[c + 1])
    norm = math.sqrt(_dot(row, row))
    if lack + most < 0.0 or norm < 1e-9:
        return r
    scene.d[r] = lack
    for c in range(2 * count):
        scene.d[r] += row[c] * scene.z_now[c]
    scene.d[r] /= norm
    for c in range(2 * count):
        row[c] /= norm
    return r + 1


@lean_kernel
def _rows_of_boats(r: int, m: int, count: int, scene: Scene) -> int:
    """Write rows of mover m about other boats; return the next row, or -1 if there are too many.

    The target is the largest of the required margin, boat i's own margin on the backups, and that of teammate j if j
    satisfies everything there.
    """
    i = scene.movers[m]
    for j in range(scene.ours.shape[0]):
        other = scene.mover_of[j]
        if j == i or not scene.neighbours[i, j] or (other >= 0 and j < i):
            continue
        if r + 1 + 6 * count > scene.C.shape[0]:
            return -1
        clear_of_boat(i, j, scene.path[i], scene, -FAR, FAR)
        scene.C[r, :] = 0.0
        _add_effect(r, i, m, 1.0, scene)
        if other >= 0:
            _add_effect(r, j, other, -1.0, scene)
        kept_m = max(required_margin_m(i, j, scene), scene.verified[i, SCORE])
        if scene.ours[j] and satisfies_all(j, scene):
            kept_m = max(kept_m, scene.verified[j, SCORE])
        r = _close_row(r, kept_m - scene.out[MARGIN], count, scene)
    return r


@lean_kernel
def _row_of_static(r: int, m: int, near_only: bool, count: int, scene: Scene) -> int:
    """Write mover m's row about obstacles near in time, or all static constraints; return the next row."""
    i, target_m = scene.movers[m], 0.0
    if near_only:
        nearest = clear_of_near_obstacles(i, i, scene, FAR, scene.out)
    else:
        nearest, target_m = clear_of_static(i, i, scene, scene.out), scene.static_target_m[i]
    if about(nearest) >= 0:
        write_slope(about(nearest), i, i, scene, scene.out)
    if scene.out[MARGIN] >= FAR:
        return r
    scene.C[r, :] = 0.0
    _add_effect(r, i, m, 1.0, scene)
    return _close_row(r, target_m + STATIC_AIM_M - scene.out[MARGIN], count, scene)


@lean_kernel
def _rows_of_limits(r: int, m: int, scene: Scene) -> int:
    """Write actuator limits of mover m: -1 <= z_t <= 1, 0 <= z_s <= sqrt(speed_weight); return the next row."""
    lowest = (-1.0, -1.0, 0.0, -math.sqrt(scene.tuning.speed_weight))
    for side in range(4):
        scene.C[r, :] = 0.0
        scene.C[r, 2 * m + side // 2] = 1.0 - 2.0 * (side % 2)
        scene.d[r] = lowest[side]
        r += 1
    return r


@lean_kernel
def linearise(count: int, scene: Scene) -> int:
    """Write the rows about the candidate; return how many, or -1: too many, or the work budget is used up."""
    if all_spent(scene) or 6 * count > scene.C.shape[0]:  # two static rows and four of limits each
        return -1
    for m in range(count):
        scene.spent[0] += scene.cost[scene.movers[m]]
    _inputs_of(count, scene)
    r = 0
    for m in range(count):
        r = _rows_of_boats(r, m, count, scene)
        if r < 0:
            break
        r = _row_of_static(r, m, True, count, scene)
        r = _row_of_static(r, m, False, count, scene)
    for m in range(count if r >= 0 else 0):
        r = _rows_of_limits(r, m, scene)
    scene.spent[0] += ROW_COST * r * count
    return r


@lean_kernel
def solve(count: int, rows: int, scene: Scene) -> bool:
    """Solve the QP, by projection if no other solver is to be called; return False when it has no solution."""
    if scene.solver_address[0] != 0:
        return bool(call_solver(scene.solver_address[0], count, rows))
    n = 2 * count
    return project(scene.C[:rows, :n], scene.d[:rows], scene.z0[:n], scene.z[:n], scene.dual[:rows])


@lean_kernel
def among_mates(scene: Scene) -> bool:
    """Return whether a nominal command fails because of teammates."""
    found = False
    for i in range(scene.ours.shape[0]):
        found = found or (scene.ours[i] and scene.violated[i] >= 0 and scene.ours[scene.violated[i]])
    return found


@lean_kernel
def _may_change(i: int, scene: Scene) -> bool:
    """Return whether boat i may be given another command than its backup, as far as itself is concerned."""
    return satisfies_all(i, scene) and scene.reason[i] != STOPPED


@lean_kernel
def begin_program(scene: Scene) -> int:
    """Make nominal commands the candidate of boats that teammates block, and of these; return how many.

    Boats whose nominal command an opponent blocks, and boats whose backup violates something, stay on their backups.
    Boats that the hard line stops stay stopped.
    """
    ours, moving = scene.ours, scene.moving
    moving[:] = False
    for i in range(ours.shape[0]):
        j = scene.violated[i]
        if ours[i] and j >= 0 and ours[j] and _may_change(i, scene):
            moving[i] = True
            moving[j] = moving[j] or (_may_change(j, scene) and not before_opponent(j, scene))
    count = list_movers(scene)
    for m in range(count):
        copy_row(scene.command[scene.movers[m]], scene.checked[scene.movers[m]])
    if count > 0:
        predict_and_score(scene)
    return count


@lean_kernel
def _take_answer(count: int, scene: Scene) -> bool:
    """Turn scaled inputs (except unchanged ones) into commands that produce them; return False if any is not finite."""
    z, root, dt_s = scene.z, math.sqrt(scene.tuning.speed_weight), scene.tuning.dt_s
    for m in range(2 * count):
        if not math.isfinite(z[m]):
            return False
    for m in range(count):
        i = scene.movers[m]
        params, top = scene.boats.params[i], scene.boats.params[i, L.MAX_SPEED]
        same_speed = abs(z[2 * m + 1] - scene.z0[2 * m + 1]) <= SAME
        if same_speed and abs(z[2 * m] - scene.z0[2 * m]) <= SAME:
            copy_row(scene.command[i], scene.checked[i])
            continue
        speed = scene.checked[i, 0] if same_speed else max(0.0, min(top, z[2 * m + 1] / root * top))
        turn = z[2 * m] * scene.gain[i, 2]
        scene.command[i, 0], scene.command[i, 1] = speed, command_for_turn(params, scene.state[i], speed, turn, dt_s)
    return True


@lean_kernel
def accept(count: int, scene: Scene) -> bool:
    """Take the answer of the QP; return whether it costs no boat more than a little by the exact check."""
    if not _take_answer(count, scene):
        return False
    predict_and_score(scene)
    return keeps_backup_scores(LITTLE_M, scene)


@lean_kernel
def end_program(scene: Scene, safe: bool, count: int) -> None:
    """Set the reasons of an accepted answer, or restore the backups."""
    for m in range(count):
        i = scene.movers[m]
        if safe:
            scene.slack_m[i], scene.reason[i], scene.solver[i] = 0.0, LEAST_CHANGE, BY_QP
        else:
            restore_verified(i, scene)
    if safe:
        note_verified(scene)
    elif count > 0:
        predict_and_score(scene)
