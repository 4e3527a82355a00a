"""A boat as the literature's filters see it: a unicycle with acceleration and turn rate as its inputs.

Between that model and the boat stands its autopilot, which takes a speed and a heading. Both ways are made here:
which inputs a wanted command amounts to, and which command makes the autopilot yield the inputs chosen. Turns go
through the autopilot's inverse, as the shield's do, so that a filter has the boat's full rudder. An acceleration a
is commanded as the speed v + T a with T = top speed / braking, which spans the range of speed commands.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate, command_for_turn, largest_turn
from steerclear.shield.platforms.limits import cruise
from steerclear.shield.platforms.usv import clamp, fresh_state, wrap_degrees

from ..jit import kernel

LONGEST_S = 60.0


class InputLimits(NamedTuple):
    """What the model of a boat may ask for: top speed, m/s, and two accelerations, m/s^2.

    ``gain_mps2`` is the mean of a start from rest to 90 % of top speed, ``brake_mps2`` what stops from top speed within
    the boat's real stopping distance.
    """

    top_speed_mps: float
    gain_mps2: float
    brake_mps2: float

    def pack(self) -> Array:
        """(3,) top speed, gain, brake."""
        return np.array(self)


@lru_cache(maxsize=64)
def input_limits(platform: Platform, dt_s: float) -> InputLimits:
    """Limits of a platform, by running its own model with step ``dt_s``, s."""
    top, steps = platform.max_speed_mps, 0
    params, state = cruise(platform, dt_s)
    for _ in range(int(LONGEST_S / dt_s)):
        actuate(params, state, 0.0, 0.0, dt_s)
        if state[L.SPEED] < 0.02 * top:
            break
    start = fresh_state(0.0, 0.0, 0.0)
    while start[L.SPEED] < 0.9 * top and steps * dt_s < LONGEST_S:
        actuate(params, start, top, 0.0, dt_s)
        steps += 1
    return InputLimits(
        top, float(start[L.SPEED]) / (steps * dt_s), 0.5 * top * top / math.hypot(state[L.X], state[L.Y])
    )


@kernel
def inputs_of_command(
    params: Array, limits: Array, state: Array, speed_mps: float, relative_deg: float, dt_s: float
) -> tuple[float, float, float]:
    """Acceleration (m/s^2) and turn rate (rad/s, clockwise) a command amounts to, and the largest turn rate (rad/s).

    The turn is that of the boat's own model in this step, so that an obeyed command is a fixed point.
    """
    now = state.copy()
    step_boat(params, now, speed_mps, relative_deg, dt_s)
    turn = math.radians(wrap_degrees(now[L.HEADING] - state[L.HEADING])) / dt_s
    most = max(math.radians(largest_turn(params, state, dt_s)) / dt_s, abs(turn))
    acceleration = (clamp(speed_mps, 0.0, limits[0]) - state[L.SPEED]) * limits[2] / limits[0]
    return clamp(acceleration, -limits[2], limits[1]), turn, most


@kernel
def command_of_inputs(
    params: Array, limits: Array, state: Array, acceleration_mps2: float, turn_radps: float, dt_s: float
) -> tuple[float, float]:
    """Speed (m/s) and relative heading (deg) that make the autopilot yield the inputs, or the nearest to them."""
    speed = clamp(state[L.SPEED] + acceleration_mps2 * limits[0] / limits[2], 0.0, limits[0])
    return speed, command_for_turn(params, state, speed, math.degrees(turn_radps) * dt_s, dt_s)
