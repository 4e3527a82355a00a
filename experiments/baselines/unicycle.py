"""Unicycle model of a boat for the literature's filters, with two inputs z (acceleration, turn), and its program.

An autopilot between filter and boat takes a speed and a heading. Turns go through the autopilot's inverse, as the
shield's do, so that a filter has the boat's full rudder. z are shares of the boat's braking and of its largest turn
in this step. A share z of braking is commanded as the speed v + z top speed, which spans the speed commands. The
program is

    minimise |z - z0|^2 + w sum e_r^2   subject to   c_r z + e_r >= d_r,   limits

with the usual relaxation: slacks e_r of barrier constraints are 0 unless no z satisfies all of them; limits are hard.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from steerclear.shield.jit import Array, copy_row, kernel
from steerclear.shield.platforms import Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate, command_for_turn, largest_turn
from steerclear.shield.platforms.limits import LONGEST_S, cruise
from steerclear.shield.platforms.usv import clamp, fresh_state, wrap_degrees

from .active_set import OPTIMAL, project

SOLVED, RELAXED, UNSOLVED = 1, 2, 3
TOLERANCE = 1e-7
SLACK_WEIGHT = 1e6


class InputLimits(NamedTuple):
    """Top speed, m/s; mean acceleration from rest to 90 % of it; braking for the boat's stopping distance, m/s^2."""

    top_speed_mps: float
    gain_mps2: float
    brake_mps2: float


@lru_cache(maxsize=64)
def input_limits(platform: Platform, dt_s: float) -> InputLimits:
    """Return limits of a platform, from rollouts of its model with step ``dt_s``, s."""
    top, steps = platform.max_speed_mps, 0
    (params, state), start = cruise(platform, dt_s), fresh_state(0.0, 0.0, 0.0)
    for _ in range(int(LONGEST_S / dt_s)):
        actuate(params, state, 0.0, 0.0, dt_s)
        if state[L.SPEED] < 0.02 * top:
            break
    while start[L.SPEED] < 0.9 * top and steps * dt_s < LONGEST_S:
        actuate(params, start, top, 0.0, dt_s)
        steps += 1
    way_m = math.hypot(state[L.X], state[L.Y])
    return InputLimits(top, float(start[L.SPEED]) / (steps * dt_s), 0.5 * top * top / way_m)


@kernel
def inputs_of_command(
    params: Array, limits: Array, state: Array, command: Array, dt_s: float, z: Array, box: Array
) -> float:
    """Write the inputs z (2,) equivalent to a command, and the least and greatest of both inputs (2, 2).

    A boat neither reverses nor exceeds its top speed in this step. The turn is that of the boat's own model in this
    step, so a command that is obeyed is a fixed point.

    Returns:
        The largest turn rate of this step, rad/s, of which the second input is a share.
    """
    now, (top, gain, brake), speed = state.copy(), (limits[0], limits[1], limits[2]), state[L.SPEED]
    step_boat(params, now, command[0], command[1], dt_s)
    turn = math.radians(wrap_degrees(now[L.HEADING] - state[L.HEADING])) / dt_s
    most = max(math.radians(largest_turn(params, state, dt_s)) / dt_s, abs(turn))
    unit = most if most > 0.0 else 1.0
    box[0, 0] = -min(1.0, max(speed, 0.0) / (brake * dt_s))
    box[0, 1] = min(gain / brake, max(top - speed, 0.0) / (brake * dt_s))
    box[1, 0], box[1, 1] = -1.0, 1.0
    acceleration = clamp((clamp(command[0], 0.0, top) - speed) * brake / top, -brake, gain)
    z[0], z[1] = clamp(acceleration / brake, box[0, 0], box[0, 1]), turn / unit
    return unit


@kernel
def command_of_inputs(
    params: Array, limits: Array, state: Array, z: Array, most_radps: float, dt_s: float
) -> tuple[float, float]:
    """Return speed, m/s, and relative heading, deg, that make the autopilot yield the inputs, or the nearest."""
    speed = clamp(state[L.SPEED] + z[0] * limits[2] * limits[0] / limits[2], 0.0, limits[0])
    return speed, command_for_turn(params, state, speed, math.degrees(z[1] * most_radps) * dt_s, dt_s)


@kernel
def holds(C: Array, d: Array, z: Array, tolerance: float) -> bool:
    """Return whether every row satisfies C z >= d - tolerance; NaN fails."""
    for r in range(len(d)):
        total = 0.0
        for c in range(len(z)):
            total += C[r, c] * z[c]
        if not total >= d[r] - tolerance:
            return False
    return True


@kernel
def solve(C: Array, d: Array, hard: int, z0: Array, z: Array, slack: Array) -> int:
    """Write the ``z`` nearest to ``z0`` (n,) with C z >= d (rows, n), of unit length; the first ``hard`` are limits.

    With status `RELAXED`, ``z`` satisfies the rows with ``slack`` (rows - hard,); with `UNSOLVED`, ``z`` is ``z0``.
    """
    (rows, n), unit = C.shape, 1.0 / math.sqrt(SLACK_WEIGHT)
    slack[:] = 0.0
    if project(C, d, z0, z) == OPTIMAL and holds(C, d, z, TOLERANCE):
        return SOLVED
    wide, start, answer = np.zeros((rows, n + rows - hard)), np.zeros(n + rows - hard), np.zeros(n + rows - hard)
    copy_row(start, z0)
    copy_row(z, z0)
    for r in range(rows):
        copy_row(wide[r], C[r])
        if r >= hard:
            wide[r, n + r - hard] = unit
    if project(wide, d, start, answer) != OPTIMAL or not holds(wide, d, answer, TOLERANCE):
        return UNSOLVED
    copy_row(z, answer[:n])
    copy_row(slack, unit * answer[n:])
    return RELAXED
