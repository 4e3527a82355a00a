"""Thrust-and-rudder boat behind a heading and a speed controller, one compiled step.

The model is that of MOOS-IvP's uSimMarine (thrust map, turn loss, turn rate) behind pMarinePID, as used by the
competition's simulator. ``step_usv`` is the whole boat as a policy commands it. ``actuate_usv`` is the hull with the
speed controller, for predictions that choose rudder and speed command directly.

The heading change of a step is

    rudder/100 * turn_gain * dt * thrust/50 * min(1, speed/full_turn_speed),

with the speed at the end of the step, before its mean with the old one is stored. uSimMarine and Pyquaticus have not
the last factor (full_turn_speed = 0). uSimMarineV22 and V23 have it, with 5 m/s in any mission: this is written from
SimEngine::propagateHeading and TurnSpeedMap of MOOS-IvP a2a9b71, where ``turn_rate`` is our ``turn_gain``.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, lean_kernel
from . import layout as L


@lean_kernel
def wrap_degrees(angle_deg: float) -> float:
    """Wrap an angle into [-180, 180]; both ends occur, as in the reference simulator.

    A non-finite angle gives NaN.
    """
    if not abs(angle_deg) <= 540.0:
        angle_deg = np.fmod(angle_deg, 360.0)
    if angle_deg > 180.0:
        return angle_deg - 360.0
    if angle_deg < -180.0:
        return angle_deg + 360.0
    return angle_deg


@lean_kernel
def clamp(value: float, low: float, high: float) -> float:
    """Limit a value to [low, high]; NaN stays NaN."""
    if value > high:
        return high
    if value < low:
        return low
    return value


@lean_kernel
def speed_of_thrust(params: Array, thrust: float) -> float:
    """Return the steady straight-line speed, m/s, of a thrust, percent; constant beyond the map's ends."""
    size = int(params[L.MAP_SIZE])
    if thrust <= params[L.MAP_THRUST]:
        return params[L.MAP_SPEED]
    for i in range(1, size):
        high = params[L.MAP_THRUST + i]
        if thrust <= high:
            low = params[L.MAP_THRUST + i - 1]
            v_low = params[L.MAP_SPEED + i - 1]
            v_high = params[L.MAP_SPEED + i]
            return v_low + (v_high - v_low) / (high - low) * (thrust - low)
    return params[L.MAP_SPEED + size - 1]


@lean_kernel
def controller(
    kp: float, ki: float, kd: float, limit: float, error: float, previous_error: float, integral: float, dt_s: float
) -> tuple[float, float]:
    """Return a PID's output before clamping, and its new integral; the derivative is 0 on the first call (NaN)."""
    derivative = 0.0
    if not math.isnan(previous_error):
        derivative = (error - previous_error) / dt_s
    integral = clamp(integral + ki * error * dt_s, -limit, limit)
    return kp * error + kd * derivative + integral, integral


@lean_kernel
def next_thrust(
    params: Array, speed_mps: float, thrust: float, error: float, integral: float, desired_mps: float, dt_s: float
) -> tuple[float, float, float]:
    """Return the thrust of this step and the speed controller's new memory (error, integral)."""
    if params[L.SPEED_FACTOR] != 0.0:
        thrust = desired_mps * params[L.SPEED_FACTOR]
    else:
        previous, error = error, desired_mps - speed_mps
        output, integral = controller(
            params[L.SPEED_KP],
            params[L.SPEED_KI],
            params[L.SPEED_KD],
            params[L.SPEED_LIMIT],
            error,
            previous,
            integral,
            dt_s,
        )
        thrust += params[L.SPEED_GAIN] * clamp(output, -params[L.MAX_THRUST], params[L.MAX_THRUST])
    if thrust < 0.01:
        thrust = 0.0
    return clamp(thrust, -params[L.MAX_THRUST], params[L.MAX_THRUST]), error, integral


@lean_kernel
def update_thrust(params: Array, state: Array, desired_speed_mps: float, dt_s: float) -> None:
    """Advance the speed controller in ``state`` by one step and set its thrust."""
    state[L.THRUST], state[L.SPEED_ERROR], state[L.SPEED_INTEGRAL] = next_thrust(
        params,
        state[L.SPEED],
        state[L.THRUST],
        state[L.SPEED_ERROR],
        state[L.SPEED_INTEGRAL],
        desired_speed_mps,
        dt_s,
    )


@lean_kernel
def update_rudder(params: Array, state: Array, heading_error_deg: float, dt_s: float) -> None:
    """Advance the heading controller; without thrust the rudder is 0 and the memory does not change."""
    if not state[L.THRUST] > 0.0:
        state[L.RUDDER] = 0.0
        return
    output, integral = controller(
        params[L.HEADING_KP],
        params[L.HEADING_KI],
        params[L.HEADING_KD],
        params[L.HEADING_LIMIT],
        heading_error_deg,
        state[L.HEADING_ERROR],
        state[L.HEADING_INTEGRAL],
        dt_s,
    )
    limit = min(params[L.MAX_RUDDER], 100.0)
    state[L.RUDDER] = clamp(output, -limit, limit)
    state[L.HEADING_ERROR] = heading_error_deg
    state[L.HEADING_INTEGRAL] = integral


@lean_kernel
def turn_of_rudder(params: Array, thrust: float, rudder: float, dt_s: float) -> float:
    """Return the heading change, deg, of one step of a boat with full way: proportional to rudder and to thrust."""
    turn = rudder * (params[L.TURN_GAIN] / 100.0) * dt_s * (1.0 + (abs(thrust) - 50.0) / 50.0)
    if thrust < 0.0:
        turn = -turn
    return turn


@lean_kernel
def way_share(params: Array, speed_mps: float) -> float:
    """Return the share of its full turn that a boat makes in a step that ends with a speed, m/s."""
    full_mps = params[L.FULL_TURN_SPEED]
    return clamp(speed_mps / full_mps, 0.0, 1.0) if full_mps > 0.0 else 1.0


@lean_kernel
def next_speed(params: Array, speed_mps: float, thrust: float, rudder: float, dt_s: float) -> float:
    """Return the speed at the end of a step, m/s, before the mean with the old one is stored."""
    return speed_towards(params, speed_mps, speed_of_thrust(params, thrust) * kept_share(params, rudder), dt_s)


@lean_kernel
def kept_share(params: Array, rudder: float) -> float:
    """Return the share of its speed that a boat retains in a turn at a rudder, percent."""
    return 1.0 - (abs(rudder) / 100.0) * params[L.TURN_LOSS]


@lean_kernel
def speed_towards(params: Array, speed_mps: float, speed: float, dt_s: float) -> float:
    """Return the speed at the end of a step that tends to ``speed``, m/s, within the platform's limits."""
    max_acc = params[L.MAX_ACC]
    max_dec = params[L.MAX_DEC]
    if max_acc > 0.0 and (speed - speed_mps) / dt_s > max_acc:
        return speed_mps + max_acc * dt_s
    if max_dec > 0.0 and (speed_mps - speed) / dt_s > max_dec:
        return speed_mps - max_dec * dt_s
    return speed


@lean_kernel
def advance_hull(params: Array, state: Array, dt_s: float) -> None:
    """Move the hull one step under the thrust and rudder in ``state`` (positions in m, headings in deg)."""
    thrust = state[L.THRUST]
    rudder = state[L.RUDDER]
    speed = next_speed(params, state[L.SPEED], thrust, rudder, dt_s)
    turn = params[L.ROTATE_SPEED] * dt_s
    if speed != 0.0:
        turn += turn_of_rudder(params, thrust, rudder, dt_s) * way_share(params, speed)
    move_along_mean(params, state, speed, state[L.HEADING] + turn, dt_s)


@lean_kernel
def move_along_mean(params: Array, state: Array, speed_mps: float, heading_deg: float, dt_s: float) -> None:
    """Move with the mean of old and new speed along the mean heading; store the mean speed."""
    mean_speed = 0.5 * (speed_mps + state[L.SPEED])
    mean_heading = math.radians(0.5 * (state[L.HEADING] + heading_deg))
    state[L.X] += math.sin(mean_heading) * mean_speed * dt_s
    state[L.Y] += math.cos(mean_heading) * mean_speed * dt_s
    state[L.SPEED] = clamp(mean_speed, 0.0, params[L.MAX_SPEED])
    state[L.HEADING] = wrap_degrees(heading_deg)


@lean_kernel
def step_usv(params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float) -> None:
    """Advance a boat by one full step: speed controller, heading controller, hull. Changes ``state`` in place."""
    update_thrust(params, state, desired_speed_mps, dt_s)
    update_rudder(params, state, heading_error_deg, dt_s)
    advance_hull(params, state, dt_s)


@lean_kernel
def actuate_usv(params: Array, state: Array, desired_speed_mps: float, rudder: float, dt_s: float) -> None:
    """Advance a boat by one step with a given rudder, percent, instead of the heading controller's."""
    update_thrust(params, state, desired_speed_mps, dt_s)
    limit = min(params[L.MAX_RUDDER], 100.0)
    state[L.RUDDER] = clamp(rudder, -limit, limit) if state[L.THRUST] > 0.0 else 0.0
    advance_hull(params, state, dt_s)


def fresh_state(x_m: float, y_m: float, heading_deg: float, speed_mps: float = 0.0) -> np.ndarray:
    """Return the state row of a boat whose autopilot has not run yet.

    Its thrust is 0, even if the boat moves: it coasts, and can hardly turn for seconds. For a boat that has been
    holding its speed, set ``row[L.THRUST]`` to `shield.tracks.thrust_at` (params, speed m/s). The shield assumes that
    thrust for boats whose thrust it does not receive (`Fleet.of`).

    Returns:
        Array of shape ``(N_STATE,)``, float64.
    """
    row = np.zeros(L.N_STATE)
    row[[L.X, L.Y, L.HEADING, L.SPEED]] = x_m, y_m, heading_deg, speed_mps
    row[[L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
    return row
