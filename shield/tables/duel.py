"""Runs of two boats of the full model, compiled. The own boat follows the table, to measure the table's error."""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, kernel
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn
from ..platforms.rudder import turn_in_step
from ..platforms.step import step_boat
from ..platforms.usv import wrap_degrees
from .lookup import WHOLE_S, Tables, table_value
from .moves import SUB_STEP_S, run_hull
from .sweep import closest

GREEDY, LEAD, PURE, WANDER = 0, 1, 2, 3
"""What the other boat does: lower the value, steer at our predicted place, or steer at us. `WANDER` is unused."""
N_RUDDERS = 5


@kernel
def look_ahead(params: Array, state: Array, trails: Array, ends: Array) -> None:
    """Fill trails (rudders, sub-steps, 2) and ends (rudders, 2: turn in rad, speed) for one table step."""
    start = np.zeros(L.N_STATE)
    for r in range(N_RUDDERS):
        start[:] = 0.0
        start[L.SPEED] = state[L.SPEED]
        rudder = (r - 2) * 0.5 * min(params[L.MAX_RUDDER], 100.0)
        ends[r, 0] = math.radians(run_hull(params, start, rudder, trails.shape[1], SUB_STEP_S, trails[r]))
        ends[r, 1] = start[L.SPEED]


@kernel
def pair_value(
    tables: Tables, table: int, own: Array, other: Array, own_trail: Array, own_end: Array, trail: Array, end: Array
) -> float:
    """Return the value after one table step of both boats, including the closest approach within it."""
    dx, dy = other[L.X] - own[L.X], other[L.Y] - own[L.Y]
    heading, theirs = math.radians(own[L.HEADING]), math.radians(other[L.HEADING])
    sin, cos = math.sin(heading), math.cos(heading)
    x, y = dx * cos - dy * sin, dx * sin + dy * cos
    psi = theirs - heading
    s, c = math.sin(psi), math.cos(psi)
    last = own_trail.shape[0] - 1
    x1 = x + trail[last, 0] * c + trail[last, 1] * s - own_trail[last, 0]
    y1 = y - trail[last, 0] * s + trail[last, 1] * c - own_trail[last, 1]
    later = table_value(tables, table, WHOLE_S, x1, y1, own_end[0], psi + end[0], own_end[1], end[1])
    return min(later, closest(x, y, s, c, own_trail, trail))


@kernel
def best_rudders(
    tables: Tables, table: int, params: Array, own: Array, other: Array, cooperative: bool, steps: int
) -> tuple[float, float, float]:
    """Return the value of the best own rudder against the other's answer, and both rudders (share of full).

    ``params`` (2, N_PARAM) and the state rows are of the own boat and the other. ``steps`` is the number of sub-steps
    in a table step.
    """
    own_trails, own_ends = np.empty((N_RUDDERS, steps, 2)), np.empty((N_RUDDERS, 2))
    trails, ends = np.empty((N_RUDDERS, steps, 2)), np.empty((N_RUDDERS, 2))
    look_ahead(params[0], own, own_trails, own_ends)
    look_ahead(params[1], other, trails, ends)
    best, ours, theirs = -1.0, 2, 2
    for turn in range(N_RUDDERS):
        r = (2 + turn) % N_RUDDERS
        low, answer = (-1.0 if cooperative else 1e9), 2
        for after in range(N_RUDDERS):
            s = (2 + after) % N_RUDDERS
            value = pair_value(tables, table, own, other, own_trails[r], own_ends[r], trails[s], ends[s])
            if (value > low) == cooperative and value != low:
                low, answer = value, s
        if low > best:
            best, ours, theirs = low, r, answer
    return best, (ours - 2) * 0.5, (theirs - 2) * 0.5


@kernel
def turn_at_full_thrust(params: Array, state: Array, rudder: float) -> float:
    """Return the turn, deg, of one step of the full model at full thrust with a rudder (share of full, 0 to 1)."""
    full = rudder * min(params[L.MAX_RUDDER], 100.0)
    return abs(turn_in_step(params, state[L.SPEED], params[L.MAX_THRUST], full, SUB_STEP_S))


@kernel
def steer(params: Array, state: Array, rudder: float) -> None:
    """Advance the full model by one step through its autopilot, at top speed and with a rudder (share of full)."""
    top = params[L.MAX_SPEED]
    turn = math.copysign(turn_at_full_thrust(params, state, abs(rudder)), rudder)
    step_boat(params, state, top, command_for_turn(params, state, top, turn, SUB_STEP_S), SUB_STEP_S)


@kernel
def chase(params: Array, pursuer: Array, prey: Array, lead: bool) -> float:
    """Return the rudder that turns the pursuer onto the prey, or onto the prey's place at the time of arrival."""
    dx, dy = prey[L.X] - pursuer[L.X], prey[L.Y] - pursuer[L.Y]
    if lead:
        time = math.sqrt(dx * dx + dy * dy) / max(pursuer[L.SPEED] + 0.5 * prey[L.SPEED], 0.5)
        heading = math.radians(prey[L.HEADING])
        dx += math.sin(heading) * prey[L.SPEED] * time
        dy += math.cos(heading) * prey[L.SPEED] * time
    error = wrap_degrees(math.degrees(math.atan2(dx, dy)) - pursuer[L.HEADING])
    turn = turn_at_full_thrust(params, pursuer, 1.0)
    if turn == 0.0:  # a boat that needs way to turn, and loses all of it at full rudder
        return 0.0
    return min(max(error / turn, -1.0), 1.0)


@kernel
def duel(
    tables: Tables,
    table: int,
    params: Array,
    own: Array,
    other: Array,
    manner: int,
    cooperative: bool,
    table_steps: int,
    steps: int,
) -> float:
    """Return the closest distance, m, over a run of the full model of ``steps`` steps; changes both state rows.

    Arguments as for `best_rudders`. ``manner`` is what the other boat does, unless both follow the table's joint
    optimum.
    """
    nearest = math.sqrt((own[L.X] - other[L.X]) ** 2 + (own[L.Y] - other[L.Y]) ** 2)
    for _ in range(steps):
        _, ours, theirs = best_rudders(tables, table, params, own, other, cooperative, table_steps)
        if not cooperative and manner != GREEDY:
            theirs = chase(params[1], other, own, manner == LEAD)
        steer(params[0], own, ours)
        steer(params[1], other, theirs)
        nearest = min(nearest, math.sqrt((own[L.X] - other[L.X]) ** 2 + (own[L.Y] - other[L.Y]) ** 2))
    return nearest
