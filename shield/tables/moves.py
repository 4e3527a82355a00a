"""The reduced model: the hull of the full model at maximum thrust, steered by the rudder.

On these boats a rudder change takes no time, and thrust is at its limit whenever it matters. The remaining state is
position, heading and stored speed. Loss of speed in a turn, limits on gaining and losing it, and the stored mean of old
and new speed are those of `platforms.usv`, called here step by step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..exceptions import TableError
from ..jit import Array, kernel
from ..platforms import layout as L
from ..platforms.platform import Platform
from ..platforms.usv import advance_hull

SUB_STEP_S = 0.1
"""Step of the full model; positions in between are stored so that no closest approach is missed."""


@dataclass(frozen=True)
class Moves:
    """Effect of one table step on a boat, for each speed node and rudder.

    Frame: x to starboard, y ahead of the heading at the start; turns clockwise.
    """

    place_m: Array  # positions after each sub-step, shape ``(speeds, rudders, sub_steps, 2)``
    turn_rad: Array  # heading change of the whole step, shape ``(speeds, rudders)``
    speed_mps: Array  # stored speed after the step, shape ``(speeds, rudders)``


@kernel
def run_hull(params: Array, state: Array, rudder: float, steps: int, dt_s: float, trail: Array) -> float:
    """Run the hull with rudder and thrust held, fill ``trail`` (steps, 2) and return the turn, deg."""
    turned = 0.0
    state[L.THRUST] = params[L.MAX_THRUST]
    state[L.RUDDER] = rudder
    for k in range(steps):
        state[L.HEADING] = 0.0
        x, y = state[L.X], state[L.Y]
        state[L.X] = state[L.Y] = 0.0
        advance_hull(params, state, dt_s)
        right, ahead = state[L.X], state[L.Y]
        sin, cos = math.sin(math.radians(turned)), math.cos(math.radians(turned))
        state[L.X] = x + right * cos + ahead * sin
        state[L.Y] = y - right * sin + ahead * cos
        turned += state[L.HEADING]
        trail[k, 0], trail[k, 1] = state[L.X], state[L.Y]
    return turned


def sub_steps(dt_s: float) -> int:
    """Return the sub-steps of a table step, which must be a multiple of `SUB_STEP_S`."""
    count = round(dt_s / SUB_STEP_S)
    if count < 1 or abs(count * SUB_STEP_S - dt_s) > 1e-9:
        raise TableError(f"the step of a table is {dt_s:g} s; make it a multiple of {SUB_STEP_S:g} s")
    return count


def moves_of(platform: Platform, speeds_mps: Array, rudders: Array, dt_s: float) -> Moves:
    """Return a platform's moves in one table step, from each speed with each rudder (share of full, -1 to 1)."""
    if platform.kind != "usv":
        raise TableError(
            f"platform {platform.name!r} is a {platform.kind}: value tables are for boats of kind 'usv'; "
            "it needs none, opponents are rolled out as pursuers instead"
        )
    count, params = sub_steps(dt_s), platform.pack()
    shape = (len(speeds_mps), len(rudders))
    place, turn, speed = np.zeros((*shape, count, 2)), np.zeros(shape), np.zeros(shape)
    full = min(platform.max_rudder, 100.0)
    for i, j in np.ndindex(shape):
        state = np.zeros(L.N_STATE)
        state[L.SPEED] = speeds_mps[i]
        turn[i, j] = math.radians(run_hull(params, state, float(full * rudders[j]), count, SUB_STEP_S, place[i, j]))
        speed[i, j] = state[L.SPEED]
    return Moves(place, turn, speed)
