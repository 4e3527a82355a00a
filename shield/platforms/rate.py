"""Boats that turn at a rate: integrators, which obey at once or within limits, and boats behind a rate loop.

The rate loop is that of ArduPilot's rovers and boats, and of boats with two propellers. A square-root controller turns
the heading error into a commanded turn rate. The rate changes within an angular acceleration, the speed within
acceleration limits and with a lag (ArduPilot: AR_AttitudeControl, AC_P_1D::sqrt_controller).

The turn rate depends on speed. A rudder needs speed (``turn_rate_per_mps`` > 0). Two propellers turn a boat at rest and
turn it the less the faster it goes (``turn_rate_at_rest_dps`` > 0, ``turn_rate_per_mps`` < 0).
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from . import layout as L
from .usv import clamp, wrap_degrees


@lean_kernel
def move_boat(params: Array, state: Array, speed_mps: float, heading_deg: float, dt_s: float) -> None:
    """Move a boat with its mean speed along its mean heading; store the *new* speed, unlike for thrust boats."""
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
    """Set the speed at once and the commanded turn rate within its limit. Changes ``state`` in place."""
    speed = clamp(desired_speed_mps, -params[L.MAX_SPEED], params[L.MAX_SPEED])
    limit = params[L.MAX_TURN_RATE]
    turn_rate = clamp(heading_error_deg / dt_s, -limit, limit)
    move_boat(params, state, speed, state[L.HEADING] + turn_rate * dt_s, dt_s)


@lean_kernel
def step_double_integrator(
    params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float
) -> None:
    """Change speed and turn rate within acceleration limits. Changes ``state`` in place."""
    acc = clamp((desired_speed_mps - state[L.SPEED]) / dt_s, -params[L.MAX_ACC], params[L.MAX_ACC])
    limit = params[L.MAX_ANGULAR_ACC]
    angular = clamp((heading_error_deg / dt_s - state[L.TURN_RATE]) / dt_s, -limit, limit)
    speed = clamp(state[L.SPEED] + acc * dt_s, -params[L.MAX_SPEED], params[L.MAX_SPEED])
    limit = params[L.MAX_TURN_RATE]
    turn_rate = clamp(state[L.TURN_RATE] + angular * dt_s, -limit, limit)
    state[L.TURN_RATE] = turn_rate
    move_boat(params, state, speed, state[L.HEADING] + turn_rate * dt_s, dt_s)


@lean_kernel
def turn_limit(params: Array, speed_mps: float) -> float:
    """Return the highest turn rate, deg/s, that the boat can hold at a speed."""
    return clamp(params[L.TURN_AT_REST] + params[L.TURN_PER_SPEED] * speed_mps, 0.0, params[L.MAX_TURN_RATE])


@lean_kernel
def rate_for_error(params: Array, error_deg: float) -> float:
    """Return the turn rate, deg/s, that a heading error commands.

    It is linear near 0; beyond, it is the highest rate from which constant braking still stops in time.
    """
    gain, braking = params[L.HEADING_KP], params[L.MAX_ANGULAR_ACC]
    linear, size = braking / (gain * gain), abs(error_deg)
    rate = gain * size if size <= linear else math.sqrt(2.0 * braking * (size - 0.5 * linear))
    return math.copysign(rate, error_deg)


@lean_kernel
def error_for_rate(params: Array, rate_dps: float) -> float:
    """Return the heading error, deg, that commands a turn rate: the inverse of `rate_for_error`."""
    gain, braking = params[L.HEADING_KP], params[L.MAX_ANGULAR_ACC]
    size = abs(rate_dps)
    error = size / gain
    if error > braking / (gain * gain):
        error = 0.5 * size * size / braking + 0.5 * braking / (gain * gain)
    return math.copysign(error, rate_dps)


@lean_kernel
def share_of_step(lag_s: float, dt_s: float) -> float:
    """Return the share of a difference that a first-order lag closes in one step."""
    return 1.0 - math.exp(-dt_s / lag_s) if lag_s > 0.0 else 1.0


@lean_kernel
def rate_after(params: Array, speed_mps: float, rate_dps: float, wanted_dps: float, dt_s: float) -> float:
    """Return the turn rate, deg/s, at the end of a step with the commanded rate ``wanted_dps``."""
    limit = turn_limit(params, speed_mps)
    reach = params[L.MAX_ANGULAR_ACC] * dt_s
    change = share_of_step(params[L.TURN_LAG], dt_s) * (clamp(wanted_dps, -limit, limit) - rate_dps)
    return rate_dps + clamp(change, -reach, reach)


@lean_kernel
def wanted_for_turn(params: Array, rate_dps: float, turn_deg: float, farthest_deg: float, dt_s: float) -> float:
    """Return the turn rate, deg/s, to command for a turn of ``turn_deg``, within that of the largest error."""
    most = rate_for_error(params, farthest_deg - 0.5 * dt_s * abs(rate_dps))
    wanted = rate_dps + (turn_deg / dt_s - rate_dps) / share_of_step(params[L.TURN_LAG], dt_s)
    return clamp(wanted, -most, most)


@lean_kernel
def run_rate(params: Array, state: Array, desired_speed_mps: float, wanted_dps: float, dt_s: float) -> None:
    """Advance a boat by one step with the commanded turn rate ``wanted_dps``. Changes ``state`` in place."""
    speed = state[L.SPEED]
    rate = rate_after(params, speed, state[L.TURN_RATE], wanted_dps, dt_s)
    lost = params[L.TURN_LOSS] * abs(rate) / params[L.MAX_TURN_RATE]
    target = clamp(desired_speed_mps, 0.0, params[L.MAX_SPEED]) * (1.0 - min(lost, 1.0))
    change = share_of_step(params[L.SPEED_LAG], dt_s) * (target - speed)
    state[L.TURN_RATE] = rate
    speed += clamp(change, -params[L.MAX_DEC] * dt_s, params[L.MAX_ACC] * dt_s)
    move_boat(params, state, speed, state[L.HEADING] + rate * dt_s, dt_s)


@lean_kernel
def step_rate(params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float) -> None:
    """Advance a boat by one full step.

    The commanded heading is held while the boat turns, so the error in the middle of the step counts.
    """
    middle_deg = heading_error_deg - 0.5 * dt_s * state[L.TURN_RATE]
    run_rate(params, state, desired_speed_mps, rate_for_error(params, middle_deg), dt_s)
