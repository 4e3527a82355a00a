"""The rows of the quadratic program: what each boat's turn and speed do to the certificates.

Scaled inputs of boat i: z_t = turn / full turn of this step (deg), z_s = sqrt(speed_weight) * speed / top speed. With
plan and closest point fixed (envelope theorem), turning a boat by d(psi) in this step rotates its whole path about its
next position, and d(v) stretches it, so with n the unit vector from neighbour to boat at the closest point and r the
boat's path from its next position to there,

    dh/dpsi = n . (r_y, -r_x)   (psi clockwise),     dh/dv = n . r / v,

and the row is the discrete-time CBF condition h(x+) >= target, linearised about the candidate command, where the target
is what the class-K rate asks for, or what the backups keep if that is more:

    h + dh/dpsi_i (psi_i - psi_i') + dh/dv_i (v_i - v_i') >= target,

less the same terms of a team-mate j, for whom n points the other way.
"""

from __future__ import annotations

import math

from ..barriers.boats import clear_of_boat, must_keep
from ..barriers.clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE
from ..barriers.registered import write_slope
from ..barriers.static import about, clear_of_near_obstacles, clear_of_static
from ..jit import Array, copy_row, lean_kernel
from ..plan import Plan
from ..platforms import layout as L
from ..platforms.actuator import full_turn
from ..platforms.step import step_boat
from ..scene import Scene, Tuning
from ..work import Work
from .verified import WORTH, keeps_all

STATIC_AIM_M = 1e-3
"""Rows of static constraints aim this much beyond the target, so that the exact check does not fail by rounding."""

SLOW_MPS = 0.3
"""Below this speed dh/dv is taken as at this speed."""

NEAR_OBSTACLES, ALL_STATIC, LIMITS = -1, -2, -3
"""What a row is about, where that is no boat: obstacles near in time, all static constraints, or the inputs' own
limits."""


@lean_kernel
def speed_effect(i: int, command: Array, scene: Scene) -> float:
    """Change of the next speed, m/s, per m/s of speed command, by a step of the model."""
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    params = boats.params[i]
    step = 0.1 * params[L.MAX_SPEED]
    if command[0] > 0.5 * params[L.MAX_SPEED]:
        step = -step
    copy_row(work.row, state[i])
    step_boat(params, work.row, command[0] + step, command[1], tuning.dt_s)
    return (work.row[L.SPEED] - work.next_state[i, L.SPEED]) / step


@lean_kernel
def _add_effect(r: int, i: int, m: int, sign: float, work: Work, plan: Plan) -> None:
    """Add to row r the share of boat i (mover m) in the clearance in ``work.out``."""
    path, C, gain = work.path[i], plan.C, plan.gain
    at, nx, ny = work.out[SAMPLE], work.out[NORMAL_X], work.out[NORMAL_Y]
    k = min(int(at), path.shape[0] - 2)
    part = min(1.0, at - k)
    x, y = path[k, 0], path[k, 1]
    if part > 0.0:  # at the end of a path nothing of it lies beyond
        x += part * (path[k + 1, 0] - x)
        y += part * (path[k + 1, 1] - y)
    rx, ry = x - work.next_state[i, L.X], y - work.next_state[i, L.Y]
    C[r, 2 * m] += sign * (nx * ry - ny * rx) * gain[i, 0]
    speed = max(work.next_state[i, L.SPEED], SLOW_MPS)
    C[r, 2 * m + 1] += sign * (nx * rx + ny * ry) / speed * gain[i, 1]


@lean_kernel
def _close_row(r: int, count: int, lack: float, tuning: Tuning, plan: Plan) -> bool:
    """Set the right-hand side so that the row reads h + C (z - z_now) >= target; scale to unit length.

    False when no inputs can violate it, or none have any effect on it.
    """
    C, d, z_now = plan.C, plan.d, plan.z_now
    if _out_of_reach(r, count, lack, tuning, plan):
        return False
    norm = 0.0
    for c in range(2 * count):
        norm += C[r, c] * C[r, c]
    norm = math.sqrt(norm)
    if norm < 1e-9:
        C[r, :] = 0.0
        return False
    d[r] = lack
    for c in range(2 * count):
        d[r] += C[r, c] * z_now[c]
    d[r] /= norm
    for c in range(2 * count):
        C[r, c] /= norm
    return True


@lean_kernel
def inputs_of(count: int, scene: Scene) -> None:
    """Scaled inputs of the candidate (``plan.z_now``) and the wanted commands (``plan.z0``), and the movers' gains.

    ``plan.gain[i]`` holds d(psi)/d(z_t) in rad, d(v)/d(z_s) in m/s, and the full turn, deg.
    """
    state, boats, tuning, work, plan = scene.state, scene.boats, scene.tuning, scene.work, scene.plan
    root = math.sqrt(tuning.speed_weight)
    for m in range(count):
        i = plan.movers[m]
        speed_mps, top = plan.commands[i, 0], boats.params[i, L.MAX_SPEED]
        full = max(full_turn(boats.params[i], state[i], speed_mps, tuning.dt_s), 1e-6)
        plan.gain[i, 0] = math.radians(full)
        plan.gain[i, 1] = speed_effect(i, plan.commands[i], scene) * top / root
        plan.gain[i, 2] = full
        turn = (work.next_state[i, L.HEADING] - state[i, L.HEADING] + 180.0) % 360.0 - 180.0
        plan.z_now[2 * m] = max(-1.0, min(1.0, turn / full))
        plan.z_now[2 * m + 1] = root * max(0.0, min(1.0, speed_mps / top))
        plan.z0[2 * m] = max(-1.0, min(1.0, plan.wanted_turn[i] / full))
        plan.z0[2 * m + 1] = root * max(0.0, min(1.0, plan.screened[i, 0] / top))


@lean_kernel
def _backups_keep(i: int, j: int, scene: Scene) -> float:
    """Margin, m, that boat i, and boat j if it keeps everything and is ours, keep from all boats on their backups."""
    kept_m = max(must_keep(i, j, scene.ours, scene.work), scene.plan.verified[i, WORTH])
    if scene.ours[j] and keeps_all(j, scene):
        kept_m = max(kept_m, scene.plan.verified[j, WORTH])
    return kept_m


@lean_kernel
def _pair_row(r: int, m: int, j: int, count: int, scene: Scene) -> bool:
    """Row of mover m against boat j; False when neither input has any effect on it."""
    work, plan = scene.work, scene.plan
    i = plan.movers[m]
    clear_of_boat(i, j, work.path[i], scene, -FAR, FAR)
    plan.C[r, :] = 0.0
    _add_effect(r, i, m, 1.0, work, plan)
    if plan.place[j] >= 0:
        _add_effect(r, j, plan.place[j], -1.0, work, plan)
    return _close_row(r, count, _backups_keep(i, j, scene) - work.out[MARGIN], scene.tuning, plan)


@lean_kernel
def _static_row(r: int, m: int, target_m: float, count: int, scene: Scene) -> bool:
    """Row of mover m about the clearance from static constraints in ``work.out``."""
    work, plan = scene.work, scene.plan
    if work.out[MARGIN] >= FAR:
        return False
    plan.C[r, :] = 0.0
    _add_effect(r, plan.movers[m], m, 1.0, work, plan)
    return _close_row(r, count, target_m + STATIC_AIM_M - work.out[MARGIN], scene.tuning, plan)


@lean_kernel
def _write_slope(nearest: int, i: int, scene: Scene) -> None:
    """Complete the clearance row in ``work.out`` of boat i by the slope of a registered barrier, if it is one's."""
    if about(nearest) >= 0:
        write_slope(about(nearest), i, i, scene, scene.work.out)


@lean_kernel
def _out_of_reach(r: int, count: int, lack: float, tuning: Tuning, plan: Plan) -> bool:
    """Whether no inputs within their limits could violate row r: the margin exceeds all they can take from it."""
    root = math.sqrt(tuning.speed_weight)
    most = 0.0
    for c in range(0, 2 * count, 2):
        most += 2.0 * abs(plan.C[r, c]) + root * abs(plan.C[r, c + 1])
    return lack + most < 0.0


@lean_kernel
def _label(r: int, i: int, about: int, plan: Plan) -> int:
    """Say whose row r is and what it is about; returns the number of the next."""
    plan.label[r, 0], plan.label[r, 1] = i, about
    return r + 1


@lean_kernel
def _box_rows(r: int, count: int, tuning: Tuning, plan: Plan) -> int:
    """Actuator limits: -1 <= z_t <= 1, 0 <= z_s <= sqrt(speed_weight); returns the row after the last."""
    C, d, root = plan.C, plan.d, math.sqrt(tuning.speed_weight)
    for m in range(count):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            C[r, :] = 0.0
            C[r, 2 * m] = sign
            d[r] = -1.0
            C[r + 1, :] = 0.0
            C[r + 1, 2 * m + 1] = sign
            d[r + 1] = 0.0 if side == 0 else -root
            for _ in range(2):
                r = _label(r, plan.movers[m], LIMITS, plan)
    return r


@lean_kernel
def _rows_of_boats(r: int, m: int, count: int, scene: Scene) -> int:
    """Rows of mover m about other boats; returns the row after the last, or -1 when there are too many."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    i = plan.movers[m]
    for j in range(ours.shape[0]):
        if j == i or not work.near[i, j] or (plan.place[j] >= 0 and j < i):
            continue
        if r + 1 + 6 * count > plan.C.shape[0]:
            return -1
        if _pair_row(r, m, j, count, scene):
            r = _label(r, i, j, plan)
    return r


@lean_kernel
def build_rows(count: int, scene: Scene) -> int:
    """Stack all rows of the movers; returns their number, or -1 when there are more than ``plan.C`` can hold.

    ``plan.label[r]`` says whose row it is, and about which other boat, or about what else, see `LIMITS`.
    """
    work, plan = scene.work, scene.plan
    if 6 * count > plan.C.shape[0]:  # two rows of static constraints and four of limits for each
        return -1
    r = 0
    for m in range(count):
        i = plan.movers[m]
        r = _rows_of_boats(r, m, count, scene)
        if r < 0:
            return -1
        _write_slope(clear_of_near_obstacles(i, i, scene, FAR, work.out), i, scene)
        if _static_row(r, m, 0.0, count, scene):
            r = _label(r, i, NEAR_OBSTACLES, plan)
        _write_slope(clear_of_static(i, i, scene, work.out), i, scene)
        if _static_row(r, m, work.static_target_m[i], count, scene):
            r = _label(r, i, ALL_STATIC, plan)
    return _box_rows(r, count, scene.tuning, plan)
