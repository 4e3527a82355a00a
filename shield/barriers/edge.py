"""The barrier of one side of a rectangular field."""

from __future__ import annotations

from ..jit import Array, lean_kernel


@lean_kernel
def to_side(x: float, y: float, side: int, field: Array) -> tuple[float, float, float]:
    """How far inside one side of a rectangle (left, low, right, high) a point is, m, and its slope.

    Infinite where there is no edge.
    """
    at = x if side % 2 == 0 else y
    sign = 1.0 if side < 2 else -1.0
    inside_m = at - field[side] if side < 2 else field[side] - at
    return (inside_m, sign, 0.0) if side % 2 == 0 else (inside_m, 0.0, sign)
