"""One step of any platform. Only here the kind selects the dynamics. Commands may be held for several substeps.

Some games take one command and move the boat several times under it without subtracting the turn made meanwhile: the
heading error is held, not the course. A parameter row with one more entry, `layout.MOVE_S`, gives the length of a
substep; a longer step is made of several. Without that entry every step is one substep.
"""

from __future__ import annotations

from ..jit import Array, lean_kernel
from . import layout as L
from .rate import step_double_integrator, step_rate, step_single_integrator
from .rudder import turn_in_step
from .usv import clamp, controller, next_speed, next_thrust, step_usv

HALVINGS = 44
"""Halvings that reduce the range of heading errors, 358 deg, to 1e-11 deg."""


@lean_kernel
def moves_in(params: Array, dt_s: float) -> int:
    """Return the number of substeps in a step."""
    if params.shape[0] <= L.MOVE_S:
        return 1
    return max(1, int(dt_s / params[L.MOVE_S] + 0.5))


@lean_kernel
def _next_speed(params: Array, speed_mps: float, thrust: float, rudder: float, move_s: float) -> float:
    """Return the stored speed after a substep, m/s, as `usv.move_along_mean` stores it."""
    return clamp(0.5 * (next_speed(params, speed_mps, thrust, rudder, move_s) + speed_mps), 0.0, params[L.MAX_SPEED])


@lean_kernel
def turn_at_rudder(params: Array, state: Array, speed_mps: float, rudder: float, move_s: float, moves: int) -> float:
    """Return the turn, deg, of a thrust boat in ``moves`` substeps with the rudder, percent, held; ``state`` stays."""
    speed, thrust = state[L.SPEED], state[L.THRUST]
    error, integral, turn = state[L.SPEED_ERROR], state[L.SPEED_INTEGRAL], 0.0
    for _ in range(moves):
        thrust, error, integral = next_thrust(params, speed, thrust, error, integral, speed_mps, move_s)
        made = rudder if thrust > 0.0 else 0.0
        turn += turn_in_step(params, speed, thrust, made, move_s)
        speed = _next_speed(params, speed, thrust, made, move_s)
    return turn


@lean_kernel
def turn_of_error(params: Array, state: Array, speed_mps: float, error_deg: float, move_s: float, moves: int) -> float:
    """Return the turn, deg, of a thrust boat whose autopilot holds a heading error for ``moves`` substeps."""
    speed, thrust, last, memory = state[L.SPEED], state[L.THRUST], state[L.HEADING_ERROR], state[L.HEADING_INTEGRAL]
    error, integral, turn = state[L.SPEED_ERROR], state[L.SPEED_INTEGRAL], 0.0
    limit = min(params[L.MAX_RUDDER], 100.0)
    kp, ki, kd, most = (
        params[L.HEADING_KP],
        params[L.HEADING_KI],
        params[L.HEADING_KD],
        params[L.HEADING_LIMIT],
    )
    for _ in range(moves):
        thrust, error, integral = next_thrust(params, speed, thrust, error, integral, speed_mps, move_s)
        rudder = 0.0
        if thrust > 0.0:
            output, memory = controller(kp, ki, kd, most, error_deg, last, memory, move_s)
            rudder, last = clamp(output, -limit, limit), error_deg
        turn += turn_in_step(params, speed, thrust, rudder, move_s)
        speed = _next_speed(params, speed, thrust, rudder, move_s)
    return turn


@lean_kernel
def error_for_turn(
    params: Array, state: Array, speed_mps: float, turn_deg: float, farthest_deg: float, move_s: float, moves: int
) -> float:
    """Return the heading error, deg, to hold for a turn of ``turn_deg`` in ``moves`` substeps, or the nearest turn.

    The turn grows with the error, so bisection finds it. Of a boat that needs way to turn it may not, at large errors:
    it then finds a turn between those at both ends, not always the nearest beyond.
    """
    low, high = -farthest_deg, farthest_deg
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if turn_of_error(params, state, speed_mps, middle, move_s, moves) < turn_deg:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@lean_kernel
def step_boat(params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float) -> None:
    """Advance one boat's ``state`` by one step, in one or several substeps; speed in m/s, heading error in deg."""
    moves = moves_in(params, dt_s)
    for _ in range(moves):
        _move_boat(params, state, desired_speed_mps, heading_error_deg, dt_s / moves)


@lean_kernel
def _move_boat(params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float) -> None:
    kind = params[L.KIND]
    if kind == L.KIND_USV:
        step_usv(params, state, desired_speed_mps, heading_error_deg, dt_s)
    elif kind == L.KIND_SINGLE_INTEGRATOR:
        step_single_integrator(params, state, desired_speed_mps, heading_error_deg, dt_s)
    elif kind == L.KIND_RATE:
        step_rate(params, state, desired_speed_mps, heading_error_deg, dt_s)
    else:
        step_double_integrator(params, state, desired_speed_mps, heading_error_deg, dt_s)
