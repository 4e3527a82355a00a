"""The barriers of a rectangular field: of each of its sides, and of a boat that is outside, of all of it."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel


@lean_kernel
def to_rectangle(x: float, y: float, field: Array) -> tuple[float, float, float]:
    """How far inside a rectangle (left, low, right, high) a point is, m, and its slope.

    Outside that is the distance to the rectangle, negative, and the slope leads there; inside no slope is told.
    """
    dx = max(0.0, field[0] - x) - max(0.0, x - field[2])
    dy = max(0.0, field[1] - y) - max(0.0, y - field[3])
    outside_m = math.sqrt(dx * dx + dy * dy)
    if outside_m > 0.0:
        return -outside_m, dx / outside_m, dy / outside_m
    return min(min(x - field[0], field[2] - x), min(y - field[1], field[3] - y)), 0.0, 0.0


@lean_kernel
def to_side(x: float, y: float, side: int, field: Array) -> tuple[float, float, float]:
    """How far inside one side of a rectangle (left, low, right, high) a point is, m, and its slope.

    Infinite where there is no edge.
    """
    at = x if side % 2 == 0 else y
    sign = 1.0 if side < 2 else -1.0
    inside_m = at - field[side] if side < 2 else field[side] - at
    return (inside_m, sign, 0.0) if side % 2 == 0 else (inside_m, 0.0, sign)
