"""Single- and double-integrator unicycles: boats that obey at once, or within acceleration limits."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from . import layout as L
from .usv import clamp, wrap_degrees


@lean_kernel
def move_boat(params: Array, state: Array, speed_mps: float, heading_deg: float, dt_s: float) -> None:
    """Mean speed along the mean heading; the *new* speed is what is stored, unlike the thrust boats."""
    mean_speed = 0.5 * (speed_mps + state[L.SPEED])
    mean_heading = math.radians(0.5 * (state[L.HEADING] + heading_deg))
    state[L.X] += math.sin(mean_heading) * mean_speed * dt_s
    state[L.Y] += math.cos(mean_heading) * mean_speed * dt_s
    state[L.SPEED] = clamp(speed_mps, 0.0, params[L.MAX_SPEED])
    state[L.HEADING] = wrap_degrees(heading_deg)


@lean_kernel
def step_single_integrator(
    params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float
) -> None:
    """Speed set at once, turn rate as asked within its limit. Changes ``state`` in place."""
    speed = clamp(desired_speed_mps, -params[L.MAX_SPEED], params[L.MAX_SPEED])
    limit = params[L.MAX_TURN_RATE]
    turn_rate = clamp(heading_error_deg / dt_s, -limit, limit)
    move_boat(params, state, speed, state[L.HEADING] + turn_rate * dt_s, dt_s)


@lean_kernel
def step_double_integrator(
    params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float
) -> None:
    """Speed and turn rate change within acceleration limits. Changes ``state`` in place."""
    acc = clamp((desired_speed_mps - state[L.SPEED]) / dt_s, -params[L.MAX_ACC], params[L.MAX_ACC])
    limit = params[L.MAX_ANGULAR_ACC]
    angular = clamp((heading_error_deg / dt_s - state[L.TURN_RATE]) / dt_s, -limit, limit)
    speed = clamp(state[L.SPEED] + acc * dt_s, -params[L.MAX_SPEED], params[L.MAX_SPEED])
    limit = params[L.MAX_TURN_RATE]
    turn_rate = clamp(state[L.TURN_RATE] + angular * dt_s, -limit, limit)
    state[L.TURN_RATE] = turn_rate
    move_boat(params, state, speed, state[L.HEADING] + turn_rate * dt_s, dt_s)
