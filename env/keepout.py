"""The keep-out circle around a team's own flag while the flag is home."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to

BUFFER_M = 0.1
"""A boat that entered the circle is put this far outside of it."""


@lean_kernel
def _solve_along_x(
    x: float, y: float, slope: float, centre: Array, radius: float, forward: bool
) -> tuple[float, float]:
    """Meeting point of a circle and the line of that slope through (x, y): the one with the larger x if ``forward``.

    Slope and intercept lose digits on steep lines. They are used all the same, in this order of operations,
    because the reference does: its lost digits are part of where its boats end up.
    """
    h, k = centre[0], centre[1]
    intercept = y - slope * x
    a = 1.0 + slope * slope
    b = 2.0 * (-h + slope * intercept - slope * k)
    c = -2.0 * intercept * k + h * h + intercept * intercept + k * k - radius * radius
    root = math.sqrt(max(0.0, b * b - 4.0 * a * c))
    x = (-b + root) / (2.0 * a) if forward else (-b - root) / (2.0 * a)
    return x, slope * x + intercept


@lean_kernel
def entry_point(inside: Array, before: Array, centre: Array, radius: float) -> tuple[float, float]:
    """Where the ray from ``inside`` through ``before`` leaves a circle, m.

    A boat that did not move is taken straight outwards from the centre. Points as (x, y) arrays.
    """
    x, y = inside[0], inside[1]
    to_x, to_y = before[0], before[1]
    if x == to_x and y == to_y:
        x, y = centre[0], centre[1]
    if x == to_x and y == to_y:
        return centre[0] + radius, centre[1]
    if x == to_x:
        reach = math.sqrt(max(0.0, radius * radius - (x - centre[0]) ** 2))
        return x, centre[1] + (reach if to_y > y else -reach)
    if y == to_y:
        reach = math.sqrt(max(0.0, radius * radius - (y - centre[1]) ** 2))
        return centre[0] + (reach if to_x > x else -reach), y
    return _solve_along_x(x, y, (to_y - y) / (to_x - x), centre, radius, to_x > x)


@lean_kernel
def keep_out(state: Array, before: Array, centre: Array, radius: float) -> None:
    """Put a boat that got inside the circle back onto it, keeping only the tangential part of its velocity.

    Args:
        state: the boat's state row, changed in place.
        before: (x, y) before the move, m.
        centre: (x, y) of the flag's home, m.
        radius: keep-out distance plus the boat's radius, m.
    """
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
