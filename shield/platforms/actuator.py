"""The boat in terms of turn and speed, and the autopilot's inverse.

A heading controller with a derivative term answers a *change* of command at once and a constant error slowly. A boat
therefore turns several times harder if its commands account for the controller. `actuate` moves a boat by a turn (deg
in this step) and a speed command. `command_for_turn` returns the heading error that makes the autopilot produce exactly
that turn in this step.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, lean_kernel
from . import layout as L
from .rate import (
    error_for_rate,
    rate_after,
    run_rate,
    step_double_integrator,
    step_single_integrator,
    turn_limit,
    wanted_for_turn,
)
from .rudder import hardest_rudder, rudder_for_turn, turn_in_step
from .step import error_for_turn, moves_in, turn_at_rudder
from .usv import actuate_usv, clamp, next_thrust, turn_of_rudder

FARTHEST_DEG = 179.0
"""Largest commanded heading error. A half turn as an absolute heading would not tell the side to turn to."""


@lean_kernel
def held_rudder(params: Array) -> float:
    """Return the rudder, percent, that the heading controller can hold: without derivative, at the largest error."""
    return min(min(params[L.MAX_RUDDER], 100.0), params[L.HEADING_KP] * FARTHEST_DEG)


@lean_kernel
def largest_turn(params: Array, state: Array, dt_s: float) -> float:
    """Return the largest turn, deg, that each of many steps can make with the present thrust (or turn-rate limit).

    Of a boat that needs way to turn it is the largest in this step.
    """
    if params[L.KIND] == L.KIND_USV:
        return abs(_hardest_turn(params, state[L.SPEED], state[L.THRUST], dt_s))
    if params[L.KIND] == L.KIND_SINGLE_INTEGRATOR:
        return params[L.MAX_TURN_RATE] * dt_s
    if params[L.KIND] == L.KIND_RATE:
        rate = abs(state[L.TURN_RATE])
        wanted = wanted_for_turn(params, rate, np.inf, FARTHEST_DEG, dt_s)
        return rate_after(params, state[L.SPEED], rate, wanted, dt_s) * dt_s
    reach = abs(state[L.TURN_RATE]) + params[L.MAX_ANGULAR_ACC] * dt_s
    return min(reach, params[L.MAX_TURN_RATE]) * dt_s


@lean_kernel
def _hardest_turn(params: Array, speed_mps: float, thrust: float, dt_s: float) -> float:
    """Return the largest turn, deg, of a step begun at a speed, m/s, with a rudder that can be held."""
    rudder = hardest_rudder(params, speed_mps, thrust, held_rudder(params), dt_s)
    return turn_in_step(params, speed_mps, thrust, rudder, dt_s)


@lean_kernel
def thrust_after(params: Array, state: Array, speed_mps: float, dt_s: float) -> float:
    """Return the thrust, percent, of this step under a speed command."""
    thrust, _, _ = next_thrust(
        params, state[L.SPEED], state[L.THRUST], state[L.SPEED_ERROR], state[L.SPEED_INTEGRAL], speed_mps, dt_s
    )
    return thrust


@lean_kernel
def full_turn(params: Array, state: Array, speed_mps: float, dt_s: float) -> float:
    """Return the largest turn, deg, that this step and any later one can make under a speed command.

    Of a boat that needs way to turn it is that of this step; if of several moves, that at full rudder.
    """
    moves = moves_in(params, dt_s)
    if moves > 1 and params[L.KIND] == L.KIND_USV:
        return turn_at_rudder(params, state, speed_mps, held_rudder(params), dt_s / moves, moves)
    if params[L.KIND] == L.KIND_USV:
        return _hardest_turn(params, state[L.SPEED], thrust_after(params, state, speed_mps, dt_s), dt_s)
    if params[L.KIND] == L.KIND_RATE:
        return turn_limit(params, state[L.SPEED]) * dt_s
    return params[L.MAX_TURN_RATE] * dt_s


@lean_kernel
def actuate(params: Array, state: Array, speed_mps: float, turn_deg: float, dt_s: float) -> None:
    """Advance ``state`` by one step, turning by ``turn_deg`` as nearly as a rudder that can be held allows."""
    kind = params[L.KIND]
    if kind == L.KIND_USV:
        thrust = thrust_after(params, state, speed_mps, dt_s)
        rudder = rudder_for_turn(params, state[L.SPEED], thrust, turn_deg, held_rudder(params), dt_s)
        actuate_usv(params, state, speed_mps, rudder, dt_s)
    elif kind == L.KIND_SINGLE_INTEGRATOR:
        step_single_integrator(params, state, speed_mps, turn_deg, dt_s)
    elif kind == L.KIND_RATE:
        wanted = wanted_for_turn(params, state[L.TURN_RATE], turn_deg, FARTHEST_DEG, dt_s)
        run_rate(params, state, speed_mps, wanted, dt_s)
    else:
        step_double_integrator(params, state, speed_mps, turn_deg, dt_s)


@lean_kernel
def command_for_turn(params: Array, state: Array, speed_mps: float, turn_deg: float, dt_s: float) -> float:
    """Return the heading error, deg, that makes the autopilot turn the boat by ``turn_deg`` in this step.

    For a thrust boat this solves kp e + kd (e - e0)/dt + clamp(I + ki e dt) = rudder for e. Here e0 and I are the
    controller's memory (derivative 0 if it has none). An error held for several substeps is found by bisection. Without
    thrust the rudder has no effect and the error returned is 0. Errors are limited to +-`FARTHEST_DEG`; the turn is
    then the nearest possible one.
    """
    if params[L.KIND] == L.KIND_RATE:
        rate = state[L.TURN_RATE]
        limit = turn_limit(params, state[L.SPEED])
        wanted = clamp(wanted_for_turn(params, rate, turn_deg, FARTHEST_DEG, dt_s), -limit, limit)
        return clamp(error_for_rate(params, wanted) + 0.5 * dt_s * rate, -FARTHEST_DEG, FARTHEST_DEG)
    moves = moves_in(params, dt_s)
    if params[L.KIND] != L.KIND_USV:
        return clamp(turn_deg / moves, -FARTHEST_DEG, FARTHEST_DEG)
    if moves > 1:
        return error_for_turn(params, state, speed_mps, turn_deg, FARTHEST_DEG, dt_s / moves, moves)
    thrust, limit = thrust_after(params, state, speed_mps, dt_s), min(params[L.MAX_RUDDER], 100.0)
    if not turn_of_rudder(params, thrust, 100.0, dt_s) > 0.0:
        return 0.0
    rudder = rudder_for_turn(params, state[L.SPEED], thrust, turn_deg, limit, dt_s)
    return _error_for_rudder(params, state, rudder, dt_s)


@lean_kernel
def _error_for_rudder(params: Array, state: Array, rudder: float, dt_s: float) -> float:
    """Invert the heading controller: first with a free integral, then with the integral clamped at the nearer end."""
    last = state[L.HEADING_ERROR]
    gain = params[L.HEADING_KP]
    offset = 0.0
    if not math.isnan(last):
        gain += params[L.HEADING_KD] / dt_s
        offset = -params[L.HEADING_KD] / dt_s * last
    limit = params[L.HEADING_LIMIT]
    step = params[L.HEADING_KI] * dt_s
    if gain + step <= 0.0:
        return 0.0
    error = (rudder - offset - state[L.HEADING_INTEGRAL]) / (gain + step)
    integral = state[L.HEADING_INTEGRAL] + step * error
    if abs(integral) > limit and gain > 0.0:
        error = (rudder - offset - clamp(integral, -limit, limit)) / gain
    return clamp(error, -FARTHEST_DEG, FARTHEST_DEG)
