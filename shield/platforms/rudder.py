"""Rudder and turn of a thrust boat in one step, and the inverse.

Without `layout.FULL_TURN_SPEED` the turn is proportional to the rudder. With it a rudder also takes away the way that
it needs. Let rho be the rudder as a share of 100 %, and all speeds shares of the full-turn speed. The turn, as a share
of that with full rudder and full way, is then

    rho * clamp(straight * (1 - loss * rho), least, most),

where ``least`` and ``most`` are what the limits on losing and gaining speed allow in this step. It rises with the
rudder, may fall beyond a peak, and rises again where the boat cannot slow down any faster. Of several rudders with the
same turn the smallest costs least speed.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, lean_kernel
from . import layout as L
from .usv import clamp, next_speed, speed_of_thrust, turn_of_rudder, way_share


@lean_kernel
def turn_in_step(params: Array, speed_mps: float, thrust: float, rudder: float, dt_s: float) -> float:
    """Return the heading change, deg, of a step begun at a speed, m/s, with a thrust and a rudder, percent."""
    turn = turn_of_rudder(params, thrust, rudder, dt_s)
    if params[L.FULL_TURN_SPEED] > 0.0:
        turn *= way_share(params, next_speed(params, speed_mps, thrust, rudder, dt_s))
    return turn


@lean_kernel
def _speed_shares(params: Array, speed_mps: float, thrust: float, dt_s: float) -> tuple[float, float, float]:
    """Return the least and the greatest speed after a step, and that straight on, as shares of the full-turn speed."""
    full_mps, least, most = params[L.FULL_TURN_SPEED], 0.0, 1.0
    if params[L.MAX_DEC] > 0.0:
        least = way_share(params, speed_mps - params[L.MAX_DEC] * dt_s)
    if params[L.MAX_ACC] > 0.0:
        most = way_share(params, speed_mps + params[L.MAX_ACC] * dt_s)
    return least, most, max(0.0, speed_of_thrust(params, thrust)) / full_mps


@lean_kernel
def _smallest_share(turn: float, least: float, most: float, straight: float, loss: float) -> float:
    """Return the smallest rudder, a share of 100 %, for a turn, a share of the full one; infinite if none makes it."""
    held = turn / least if least > 0.0 else np.inf
    square = straight * straight - 4.0 * straight * loss * turn
    if not (square >= 0.0 and straight > 0.0 and most > 0.0):
        return held
    root = math.sqrt(square)
    begins = max(2.0 * turn / (straight + root), turn / most)
    ends = 0.5 * (straight + root) / (straight * loss) if loss > 0.0 else np.inf
    return min(held, begins) if begins <= ends else held


@lean_kernel
def hardest_rudder(params: Array, speed_mps: float, thrust: float, limit: float, dt_s: float) -> float:
    """Return the rudder, percent in [0, ``limit``], that turns a boat the most in a step begun at a speed, m/s."""
    loss = params[L.TURN_LOSS]
    if params[L.FULL_TURN_SPEED] <= 0.0 or loss <= 0.0:
        return limit
    _, most, straight = _speed_shares(params, speed_mps, thrust, dt_s)
    peak = 50.0 / loss
    if straight > 0.0:
        peak = max(peak, 100.0 * (straight - most) / (straight * loss))
    peak = min(peak, limit)
    at_limit = abs(turn_in_step(params, speed_mps, thrust, limit, dt_s))
    return limit if at_limit > abs(turn_in_step(params, speed_mps, thrust, peak, dt_s)) else peak


@lean_kernel
def rudder_for_turn(
    params: Array, speed_mps: float, thrust: float, turn_deg: float, limit: float, dt_s: float
) -> float:
    """Return the rudder, percent within +-``limit``, for a turn, deg, of a step begun at a speed; or for the nearest.

    Without thrust no rudder turns the boat: 0.
    """
    full = turn_of_rudder(params, thrust, 100.0, dt_s)
    if not full > 0.0:
        return 0.0
    if params[L.FULL_TURN_SPEED] <= 0.0:
        return clamp(100.0 * turn_deg / full, -limit, limit)
    if turn_deg == 0.0:
        return 0.0
    least, most, straight = _speed_shares(params, speed_mps, thrust, dt_s)
    rudder = 100.0 * _smallest_share(abs(turn_deg) / full, least, most, straight, params[L.TURN_LOSS])
    if not rudder <= limit:
        rudder = hardest_rudder(params, speed_mps, thrust, limit, dt_s)
    return math.copysign(rudder, turn_deg)
