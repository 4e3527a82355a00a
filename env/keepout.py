"""The keep-out circle around a team's own flag while the flag is home."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to

BUFFER_M = 0.1
"""A boat that entered the circle is put this far outside of it."""


@kernel
def entry_point(inside: Array, before: Array, centre: Array, radius: float) -> tuple[float, float]:
    """Where the ray from ``inside`` through ``before`` leaves a circle, m.

    A boat that did not move is taken straight outwards from the centre. Points as (x, y) arrays.
    """
    dx, dy = before[0] - inside[0], before[1] - inside[1]
    from_x, from_y = inside[0], inside[1]
    if dx == 0.0 and dy == 0.0:
        dx, dy = inside[0] - centre[0], inside[1] - centre[1]
        from_x, from_y = centre[0], centre[1]
    if dx == 0.0 and dy == 0.0:
        dx = 1.0
    length = math.hypot(dx, dy)
    dx, dy = dx / length, dy / length
    to_x, to_y = centre[0] - from_x, centre[1] - from_y
    ahead = to_x * dx + to_y * dy
    aside = to_x * dy - to_y * dx
    share = ahead + math.sqrt(max(0.0, radius * radius - aside * aside))
    return from_x + share * dx, from_y + share * dy


@kernel
def keep_out(state: Array, before: Array, centre: Array, radius: float) -> None:
    """Put a boat that is inside the circle back onto it, keeping only the tangential part of its velocity.

    Args:
        state: the boat's state row, changed in place.
        before: (x, y) before the move, m.
        centre: (x, y) of the flag's home, m.
        radius: keep-out distance plus the boat's radius, m.
    """
    x, y = state[L.X], state[L.Y]
    if not math.hypot(x - centre[0], y - centre[1]) < radius:
        return
    x, y = entry_point(state[: L.Y + 1], before, centre, radius + BUFFER_M)
    heading = math.radians(state[L.HEADING])
    # single precision, as in the reference
    velocity_x = np.float64(np.float32(state[L.SPEED] * math.sin(heading)))
    velocity_y = np.float64(np.float32(state[L.SPEED] * math.cos(heading)))
    out_x, out_y = x - centre[0], y - centre[1]
    length = math.hypot(out_x, out_y)
    tangent_x, tangent_y = out_y / length, -out_x / length
    along = velocity_x * tangent_x + velocity_y * tangent_y
    state[L.X], state[L.Y] = x, y
    state[L.SPEED] = abs(along)
    state[L.HEADING] = heading_to(along * tangent_x, along * tangent_y)
