"""Rows of the program: what each boat's turn and speed command do to the values, linearised about a candidate.

Inputs of own boat i: z_t = turn / full turn of this step, z_s = sqrt(speed_weight) * speed command / top speed. With x+
the state after the candidate, the row of a pair is

    V(x+) + dV/dpsi (psi - psi+) + dV/dv (v - v+) >= R + target,

with the same terms of a team-mate decided for together, and one row for each way an opponent may move.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import thrust_after
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import turn_of_rudder

from ..jit import kernel
from .values import WAYS, Setup, joint, slope_of

AIM_M = 0.01
"""Rows aim this much beyond the target, so that curvature of the value does not fail the exact check."""


class Pairs(NamedTuple):
    """Pairs of n boats that count.

    ``near`` (n, n) which these are, ``ways`` (n, WAYS, N_STATE) opponents one step on, ``target`` (n, n) margins to
    keep and ``margin`` (n, n) those there are, m.
    """

    near: BoolArray
    ways: Array
    target: Array
    margin: Array


class Program(NamedTuple):
    """The program of m boats.

    ``slot`` (n,) place of each own boat in it, -1 for others, ``z`` (n, 5) see `set_inputs`, ``z_now`` (2 m,) inputs of
    the candidate, ``C`` (rows, 2 m) and ``d`` (rows,) its rows, of which ``WAYS * n * n + 4 * n`` are enough.
    """

    slot: IntArray
    z: Array
    z_now: Array
    C: Array
    d: Array


@kernel
def set_inputs(setup: Setup, state: Array, command: Array, later: Array, row: Array, i: int, z: Array) -> None:
    """Write boat i's ``z`` (5,): turn and speed input, full turn deg, d(psi)/dz_t rad and d(v)/dz_s m/s."""
    params, root = setup.params[i], math.sqrt(setup.speed_weight)
    thrust = thrust_after(params, state, command[0], setup.dt_s)
    full = max(abs(turn_of_rudder(params, thrust, min(params[L.MAX_RUDDER], 100.0), setup.dt_s)), 1e-6)
    top = params[L.MAX_SPEED]
    turn = (later[L.HEADING] - state[L.HEADING] + 180.0) % 360.0 - 180.0
    step = -0.1 * top if command[0] > 0.5 * top else 0.1 * top
    row[:] = state
    step_boat(params, row, command[0] + step, command[1], setup.dt_s)
    z[0] = max(-1.0, min(1.0, turn / full))
    z[1] = root * max(0.0, min(1.0, command[0] / top))
    z[2] = full
    z[3] = math.radians(full)
    z[4] = (row[L.SPEED] - later[L.SPEED]) / step * top / root


@kernel
def _close(C: Array, d: Array, r: int, lack: float, z_now: Array, root: float) -> bool:
    """Finish row r, C (z - z_now) >= lack, at unit length; False when no inputs can violate or change it."""
    square, most = 0.0, 0.0
    for c in range(C.shape[1]):
        square += C[r, c] * C[r, c]
        most += abs(C[r, c]) * (2.0 if c % 2 == 0 else root)
    norm = math.sqrt(square)
    if norm < 1e-9 or lack + most < 0.0:
        return False
    d[r] = lack
    for c in range(C.shape[1]):
        d[r] += C[r, c] * z_now[c]
    d[r] /= norm
    C[r, :] /= norm
    return True


@kernel
def _pair_rows(
    setup: Setup, ours: BoolArray, i: int, j: int, later: Array, pairs: Pairs, program: Program, r: int
) -> int:
    """Rows of boat i against boat j; returns the number of the next."""
    slot, z, z_now, C, d = program
    both, root = joint(setup, ours, i, j), math.sqrt(setup.speed_weight)
    for way in range(WAYS if setup.team[i] != setup.team[j] else 1):
        slope = slope_of(setup, i, j, later[i], later[j] if both else pairs.ways[j, way])
        C[r, :] = 0.0
        C[r, 2 * slot[i]], C[r, 2 * slot[i] + 1] = slope.own_heading * z[i, 3], slope.own_speed * z[i, 4]
        if both:
            C[r, 2 * slot[j]], C[r, 2 * slot[j] + 1] = slope.other_heading * z[j, 3], slope.other_speed * z[j, 4]
        if _close(C, d, r, setup.radius_m + pairs.target[i, j] + AIM_M - slope.value_m, z_now, root):
            r += 1
    return r


@kernel
def build_rows(setup: Setup, ours: BoolArray, pairs: Pairs, later: Array, program: Program) -> int:
    """Stack the rows of all near pairs and the limits of the inputs; returns how many rows there are."""
    near, z_now, C, d = pairs.near, program.z_now, program.C, program.d
    n, r = near.shape[0], 0
    for i in range(n):
        for j in range(n):
            if near[i, j]:
                r = _pair_rows(setup, ours, i, j, later, pairs, program, r)
    root = math.sqrt(setup.speed_weight)
    for c in range(z_now.shape[0]):
        for side in range(2):
            C[r, :] = 0.0
            C[r, c] = 1.0 - 2.0 * side
            low, high = (-1.0, 1.0) if c % 2 == 0 else (0.0, root)
            d[r] = low if side == 0 else -high
            r += 1
    return r
