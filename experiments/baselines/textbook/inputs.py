"""A boat as the literature's filters see it: a unicycle, which accelerates and turns, by two inputs z.

Between it and the boat stands an autopilot, which takes a speed and a heading. Turns go through its inverse, as the
shield's do, so that a filter has the boat's full rudder. z are shares of the boat's braking and of its largest turn
now; a share z of braking is commanded as the speed v + z top speed, which spans the speed commands.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate, command_for_turn, largest_turn
from steerclear.shield.platforms.limits import LONGEST_S, cruise
from steerclear.shield.platforms.usv import clamp, fresh_state, wrap_degrees

from ...jit import kernel


class InputLimits(NamedTuple):
    """Top speed, m/s; mean acceleration from rest to 90 % of it, and braking that stops in the boat's way, m/s^2."""

    top_speed_mps: float
    gain_mps2: float
    brake_mps2: float


@lru_cache(maxsize=64)
def input_limits(platform: Platform, dt_s: float) -> InputLimits:
    """Limits of a platform, by running its own model with step ``dt_s``, s."""
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
    """Write what a command amounts to, z (2,), and the least and greatest of both inputs (2, 2).

    A boat neither reverses nor tops its top speed in this step. The turn is that of the boat's own model in it, so that
    an obeyed command is a fixed point.

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
    """Speed, m/s, and relative heading, deg, that make the autopilot yield the inputs, or the nearest to them."""
    speed = clamp(state[L.SPEED] + z[0] * limits[2] * limits[0] / limits[2], 0.0, limits[0])
    return speed, command_for_turn(params, state, speed, math.degrees(z[1] * most_radps) * dt_s, dt_s)
