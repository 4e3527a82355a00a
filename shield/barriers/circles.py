"""The barrier of a circle: obstacles that are round, circles at which boats are stopped, keep-out circles."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel


@lean_kernel
def to_circle(x: float, y: float, circle: Array) -> tuple[float, float, float]:
    """Distance, m, from a circle (negative inside) and its slope, the unit vector away from it."""
    dx, dy = x - circle[0], y - circle[1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= 1e-9:
        return -circle[2], 1.0, 0.0
    return distance - circle[2], dx / distance, dy / distance
