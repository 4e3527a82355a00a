"""The barrier of a wall, a segment that boats keep off by their hull and do not go through."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel


@lean_kernel
def to_wall(x: float, y: float, wall: Array, hull_m: float) -> tuple[float, float, float]:
    """Distance, m, from what is within ``hull_m`` of a wall, and its slope, the unit vector away from it."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, ((x - wall[0]) * dx + (y - wall[1]) * dy) / length))
    rx, ry = x - wall[0] - part * dx, y - wall[1] - part * dy
    distance = math.sqrt(rx * rx + ry * ry)
    if distance <= 1e-9:
        return -hull_m, 1.0, 0.0
    return distance - hull_m, rx / distance, ry / distance


@lean_kernel
def _side(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """On which side of the line from a to b a point is: positive left, negative right."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@lean_kernel
def goes_through(x0: float, y0: float, x1: float, y1: float, wall: Array) -> bool:
    """Whether the way from one point to another goes through a wall."""
    ax, ay, bx, by = wall
    if (_side(x0, y0, ax, ay, bx, by) > 0.0) == (_side(x1, y1, ax, ay, bx, by) > 0.0):
        return False
    return (_side(ax, ay, x0, y0, x1, y1) > 0.0) != (_side(bx, by, x0, y0, x1, y1) > 0.0)
