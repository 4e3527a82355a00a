"""Margins and gradients of the shapes of static constraints: circles, walls, the sides of a field, and all of it."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel


@lean_kernel
def to_circle(x: float, y: float, circle: Array) -> tuple[float, float, float]:
    """Return the distance from a circle, m (negative inside), and its gradient, the unit vector away from it."""
    dx, dy = x - circle[0], y - circle[1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= 1e-9:
        return -circle[2], 1.0, 0.0
    return distance - circle[2], dx / distance, dy / distance


@lean_kernel
def to_wall(x: float, y: float, wall: Array, obstacle_clearance_m: float) -> tuple[float, float, float]:
    """Return the distance from a wall less the clearance, m, and its gradient, the unit vector away from it."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, ((x - wall[0]) * dx + (y - wall[1]) * dy) / length))
    rx, ry = x - wall[0] - part * dx, y - wall[1] - part * dy
    distance = math.sqrt(rx * rx + ry * ry)
    if distance <= 1e-9:
        return -obstacle_clearance_m, 1.0, 0.0
    return distance - obstacle_clearance_m, rx / distance, ry / distance


@lean_kernel
def _side(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return on which side of the line from a to b a point is: positive left, negative right."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@lean_kernel
def goes_through(x0: float, y0: float, x1: float, y1: float, wall: Array) -> bool:
    """Return whether the way from one point to another crosses a wall."""
    ax, ay, bx, by = wall
    if (_side(x0, y0, ax, ay, bx, by) > 0.0) == (_side(x1, y1, ax, ay, bx, by) > 0.0):
        return False
    return (_side(ax, ay, x0, y0, x1, y1) > 0.0) != (_side(bx, by, x0, y0, x1, y1) > 0.0)


@lean_kernel
def to_rectangle(x: float, y: float, field: Array) -> tuple[float, float, float]:
    """Return how far inside a rectangle (left, low, right, high) a point is, m, and the gradient.

    Outside, it is minus the distance to the rectangle, and the gradient points there. Inside, the gradient is given as
    0.
    """
    dx = max(0.0, field[0] - x) - max(0.0, x - field[2])
    dy = max(0.0, field[1] - y) - max(0.0, y - field[3])
    outside_m = math.sqrt(dx * dx + dy * dy)
    if outside_m > 0.0:
        return -outside_m, dx / outside_m, dy / outside_m
    return min(min(x - field[0], field[2] - x), min(y - field[1], field[3] - y)), 0.0, 0.0


@lean_kernel
def to_side(x: float, y: float, side: int, field: Array) -> tuple[float, float, float]:
    """Return how far inside one side of a rectangle (left, low, right, high) a point is, m, and the gradient.

    Infinite where there is no edge.
    """
    at = x if side % 2 == 0 else y
    sign = 1.0 if side < 2 else -1.0
    inside_m = at - field[side] if side < 2 else field[side] - at
    return (inside_m, sign, 0.0) if side % 2 == 0 else (inside_m, 0.0, sign)
