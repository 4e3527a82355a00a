"""The rows of the quadratic program: what each boat's turn and speed do to the certificates.

Scaled inputs of boat i: z_t = turn / full turn of this step (deg), z_s = sqrt(speed_weight) * speed / top speed. With
plan and closest point fixed (envelope theorem), turning a boat by d(psi) in this step rotates its whole path about its
next position, and d(v) stretches it, so with n the unit vector from neighbour to boat at the closest point and r the
boat's path from its next position to there,

    dh/dpsi = n . (r_y, -r_x)   (psi clockwise),     dh/dv = n . r / v,

and the row is the discrete-time CBF condition h(x+) >= target, linearised about the candidate command:

    h + dh/dpsi_i (psi_i - psi_i') + dh/dv_i (v_i - v_i') >= target,

less the same terms of a team-mate j, for whom n points the other way.
"""

from __future__ import annotations

import math

from .certificates.clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE
from .certificates.fixed_things import clear_of_fixed, clear_of_near_obstacles
from .certificates.hunters import clear_of_hunter, hunts
from .certificates.manoeuvre import clear_of_boat, must_keep
from .certificates.values import WAYS, looked_up, table_slope
from .jit import Array, BoolArray, IntArray, copy_row, lean_kernel
from .platforms import layout as L
from .platforms.actuator import full_turn
from .platforms.step import step_boat
from .scene import Boats, Fixed, Tuning
from .work import Work

AIM_M = 0.02
"""Rows aim this much beyond the target so that the exact check after the solve does not fail by rounding."""

FIXED_AIM_M = 1e-3
"""The same of fixed things: a boat along an edge is not to be sent away from it for more."""

SLOW_MPS = 0.3
"""Below this speed dh/dv is taken as at this speed."""

PAIR_ROW, FIXED_ROW, BOX_ROW = 0, 1, 2
"""Classes of rows: boats and obstacles near in time give way last, other fixed things before them, limits never."""

NOBODY = -1
"""Neighbour of a row that is not about a boat."""


@lean_kernel
def speed_effect(i: int, command: Array, state: Array, boats: Boats, tuning: Tuning, work: Work) -> float:
    """Change of the next speed, m/s, per m/s of speed command, by a step of the model."""
    params = boats.params[i]
    step = 0.1 * params[L.MAX_SPEED]
    if command[0] > 0.5 * params[L.MAX_SPEED]:
        step = -step
    copy_row(work.row, state[i])
    step_boat(params, work.row, command[0] + step, command[1], tuning.dt_s)
    return (work.row[L.SPEED] - work.next_state[i, L.SPEED]) / step


@lean_kernel
def _add_effect(
    C: Array,
    r: int,
    i: int,
    sign: float,
    at: float,
    nx: float,
    ny: float,
    path: Array,
    first: int,
    gain: Array,
    work: Work,
) -> None:
    """Add boat i's share to row r; ``gain`` holds d(psi)/d(z_t) in rad and d(v)/d(z_s) in m/s."""
    k = min(int(at), path.shape[0] - 2)
    part = min(1.0, at - k)
    x, y = path[k, 0], path[k, 1]
    if part > 0.0:  # at the end of a path nothing of it lies beyond
        x += part * (path[k + 1, 0] - x)
        y += part * (path[k + 1, 1] - y)
    rx, ry = x - work.next_state[i, L.X], y - work.next_state[i, L.Y]
    C[r, first] += sign * (nx * ry - ny * rx) * gain[i, 0]
    speed = max(work.next_state[i, L.SPEED], SLOW_MPS)
    C[r, first + 1] += sign * (nx * rx + ny * ry) / speed * gain[i, 1]


@lean_kernel
def _close_row(C: Array, d: Array, lack: float, r: int, z_now: Array) -> bool:
    """Set the right-hand side so that the row reads h + C (z - z_now) >= target; scale to unit length."""
    norm = 0.0
    for c in range(C.shape[1]):
        norm += C[r, c] * C[r, c]
    norm = math.sqrt(norm)
    if norm < 1e-9:
        C[r, :] = 0.0
        return False
    d[r] = lack
    for c in range(z_now.shape[0]):
        d[r] += C[r, c] * z_now[c]
    d[r] /= norm
    for c in range(C.shape[1]):
        C[r, c] /= norm
    return True


@lean_kernel
def inputs_of(
    commands: Array,
    wanted: Array,
    movers: IntArray,
    state: Array,
    boats: Boats,
    tuning: Tuning,
    work: Work,
    wanted_turn: Array,
    gain: Array,
    z_now: Array,
    z0: Array,
) -> None:
    """Scaled inputs of the candidate (``z_now``) and the wanted commands (``z0``), and the gains of the movers.

    ``wanted_turn`` is the turn, deg, the autopilot makes of each wanted command; ``gain[i, 2]`` the full turn, deg.
    """
    root = math.sqrt(tuning.speed_weight)
    for m in range(movers.shape[0]):
        i = movers[m]
        full = max(full_turn(boats.params[i], state[i], commands[i, 0], tuning.dt_s), 1e-6)
        top = boats.params[i, L.MAX_SPEED]
        gain[i, 0] = math.radians(full)
        gain[i, 1] = speed_effect(i, commands[i], state, boats, tuning, work) * top / root
        gain[i, 2] = full
        turn = (work.next_state[i, L.HEADING] - state[i, L.HEADING] + 180.0) % 360.0 - 180.0
        z_now[2 * m] = max(-1.0, min(1.0, turn / full))
        z_now[2 * m + 1] = root * max(0.0, min(1.0, commands[i, 0] / top))
        z0[2 * m] = max(-1.0, min(1.0, wanted_turn[i] / full))
        z0[2 * m + 1] = root * max(0.0, min(1.0, wanted[i, 0] / top))


@lean_kernel
def _pair_row(
    i: int,
    j: int,
    m: int,
    place: IntArray,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    tuning: Tuning,
    work: Work,
    gain: Array,
    z_now: Array,
    C: Array,
    d: Array,
    r: int,
) -> bool:
    """Row of boat i (mover m) against boat j; False when neither input has any effect on it."""
    clear_of_boat(i, j, work.path[i], state, ours, boats, tuning, work, -FAR, FAR)
    if hunts(i, j, ours, boats) and not work.breach[i, j] and not looked_up(i, j, i, ours, boats, work):
        copy_row(work.spare2, work.out)
        clear_of_hunter(i, j, i, state, ours, boats, tuning, work, -FAR, tuning.margin_cap_m)
        if work.out[MARGIN] > work.spare2[MARGIN]:
            copy_row(work.out, work.spare2)
    k, nx, ny = work.out[SAMPLE], work.out[NORMAL_X], work.out[NORMAL_Y]
    target = work.threat_target_m[i, j] if hunts(i, j, ours, boats) else must_keep(i, j, ours, work)
    lack = target + AIM_M - work.out[MARGIN]
    C[r, :] = 0.0
    _add_effect(C, r, i, 1.0, k, nx, ny, work.path[i], 2 * m, gain, work)
    if place[j] >= 0:
        _add_effect(C, r, j, -1.0, k, nx, ny, work.path[j], 2 * place[j], gain, work)
    if _out_of_reach(C, r, lack, tuning):
        return False
    return _close_row(C, d, lack, r, z_now)


@lean_kernel
def _table_row(
    i: int,
    j: int,
    way: int,
    m: int,
    boats: Boats,
    tuning: Tuning,
    work: Work,
    gain: Array,
    z_now: Array,
    C: Array,
    d: Array,
    r: int,
) -> bool:
    """Row of boat i (mover m) against opponent j moved on in one of its ways, from the slope of the value table."""
    slope = table_slope(i, j, way, boats, work)
    C[r, :] = 0.0
    C[r, 2 * m] = slope.own_heading * gain[i, 0]
    C[r, 2 * m + 1] = slope.own_speed * gain[i, 1]
    lack = work.threat_target_m[i, j] + AIM_M + work.radius[i, j] + boats.table_margin_m - slope.value_m
    if _out_of_reach(C, r, lack, tuning):
        return False
    return _close_row(C, d, lack, r, z_now)


@lean_kernel
def _fixed_row(
    i: int, m: int, target_m: float, tuning: Tuning, work: Work, gain: Array, z_now: Array, C: Array, d: Array, r: int
) -> bool:
    """Row of boat i (mover m) about the clearance from fixed things in ``work.out``."""
    if work.out[MARGIN] >= FAR:
        return False
    lack = target_m + FIXED_AIM_M - work.out[MARGIN]
    C[r, :] = 0.0
    at, nx, ny = work.out[SAMPLE], work.out[NORMAL_X], work.out[NORMAL_Y]
    _add_effect(C, r, i, 1.0, at, nx, ny, work.path[i], 2 * m, gain, work)
    return not _out_of_reach(C, r, lack, tuning) and _close_row(C, d, lack, r, z_now)


@lean_kernel
def _out_of_reach(C: Array, r: int, lack: float, tuning: Tuning) -> bool:
    """Whether no inputs within their limits could violate row r: the margin exceeds all they can take from it."""
    root = math.sqrt(tuning.speed_weight)
    most = 0.0
    for c in range(0, C.shape[1], 2):
        most += 2.0 * abs(C[r, c]) + root * abs(C[r, c + 1])
    return lack + most < 0.0


@lean_kernel
def _box_rows(movers: IntArray, tuning: Tuning, C: Array, d: Array, kind: IntArray, label: IntArray, r: int) -> int:
    """Actuator limits: -1 <= z_t <= 1, 0 <= z_s <= sqrt(speed_weight); returns the row after the last."""
    root = math.sqrt(tuning.speed_weight)
    for m in range(movers.shape[0]):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            C[r, :] = 0.0
            C[r, 2 * m] = sign
            d[r] = -1.0
            C[r + 1, :] = 0.0
            C[r + 1, 2 * m + 1] = sign
            d[r + 1] = 0.0 if side == 0 else -root
            for k in range(r, r + 2):
                kind[k], label[k, 0], label[k, 1] = BOX_ROW, NOBODY, NOBODY
            r += 2
    return r


@lean_kernel
def build_rows(
    movers: IntArray,
    place: IntArray,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    tuning: Tuning,
    work: Work,
    gain: Array,
    z_now: Array,
    C: Array,
    d: Array,
    kind: IntArray,
    label: IntArray,
) -> int:
    """Stack all rows of the movers; returns their number, or -1 when there are more than ``C`` can hold.

    ``kind[r]`` is the class of a row, ``label[r]`` = (boat, neighbour), neighbour -1 for fixed things and limits.
    """
    n = state.shape[0]
    if 6 * movers.shape[0] > C.shape[0]:  # two rows of fixed things and four of limits for each
        return -1
    r = 0
    for m in range(movers.shape[0]):
        i = movers[m]
        for j in range(n):
            if j == i or not work.near[i, j] or (place[j] >= 0 and j < i):
                continue
            if r + WAYS + 1 + 6 * movers.shape[0] > C.shape[0]:
                return -1
            if looked_up(i, j, i, ours, boats, work):
                for way in range(WAYS):
                    if _table_row(i, j, way, m, boats, tuning, work, gain, z_now, C, d, r):
                        kind[r], label[r, 0], label[r, 1] = PAIR_ROW, i, j
                        r += 1
            if _pair_row(i, j, m, place, state, ours, boats, tuning, work, gain, z_now, C, d, r):
                kind[r], label[r, 0], label[r, 1] = PAIR_ROW, i, j
                r += 1
        clear_of_near_obstacles(i, i, state, boats, fixed, work, work.out)
        if _fixed_row(i, m, 0.0, tuning, work, gain, z_now, C, d, r):
            kind[r], label[r, 0], label[r, 1] = PAIR_ROW, i, NOBODY
            r += 1
        clear_of_fixed(i, i, state, boats, fixed, work, work.out)
        if _fixed_row(i, m, work.fixed_target_m[i], tuning, work, gain, z_now, C, d, r):
            kind[r], label[r, 0], label[r, 1] = FIXED_ROW, i, NOBODY
            r += 1
    return _box_rows(movers, tuning, C, d, kind, label, r)
