"""Following plans of macro-actions in the live games, compiled; a boat too near to another turns away from it."""

from __future__ import annotations

import math

from steerclear.env.arrays import Games, Rules
from steerclear.shield.jit import Array, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from .rollout import STOP

KEEP_OFF_M = 5.0
"""A boat nearer than this to another, and not past it, turns away from it."""


@lean_kernel
def follow_plans(rules: Rules, games: Games, plans: IntArray, own: IntArray, out: Array) -> None:
    """Commands of a team's boats for this step.

    Args:
        rules: of the games.
        games: B games.
        plans: (B, n, H) macro-actions of all boats; the first is the one to follow.
        own: (k,) numbers of the team's boats.
        out: (B, k, 2), written: speed m/s, relative heading deg.
    """
    for b in range(plans.shape[0]):
        state = games.state[b]
        for k in range(own.size):
            i = own[k]
            near = _too_near(state, i)
            action = plans[b, i, 0]
            heading = 45.0 * action
            if near >= 0:
                away_x, away_y = state[i, L.X] - state[near, L.X], state[i, L.Y] - state[near, L.Y]
                heading = math.degrees(math.atan2(away_x, away_y))
            stops = near < 0 and action == STOP
            out[b, k, 0] = 0.0 if stops else rules.max_speed[i]
            out[b, k, 1] = 0.0 if stops else wrap_degrees(heading - state[i, L.HEADING])


@lean_kernel
def _too_near(state: Array, i: int) -> int:
    """Number of the boat nearest to boat ``i`` if it is within `KEEP_OFF_M` and not abaft the beam; -1 if it is not."""
    near, least = -1, math.inf
    for j in range(state.shape[0]):
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
        if j != i and gap < least:
            near, least = j, gap
    if near < 0 or least > KEEP_OFF_M:
        return -1
    bearing = math.degrees(math.atan2(state[near, L.X] - state[i, L.X], state[near, L.Y] - state[i, L.Y]))
    return near if abs(wrap_degrees(bearing - state[i, L.HEADING])) < 90.0 else -1
