"""The barrier of a rectangular field's edge."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel


@lean_kernel
def to_edge(x: float, y: float, field: Array) -> tuple[float, float, float]:
    """How far inside the nearest side of a rectangle (left, low, right, high) a point is, m, and its slope.

    Infinite where there is no edge.
    """
    least_m, nx, ny = math.inf, 0.0, 0.0
    for side in range(4):
        at = x if side % 2 == 0 else y
        sign = 1.0 if side < 2 else -1.0
        inside_m = at - field[side] if side < 2 else field[side] - at
        if inside_m < least_m:
            least_m = inside_m
            nx, ny = (sign, 0.0) if side % 2 == 0 else (0.0, sign)
    return least_m, nx, ny
