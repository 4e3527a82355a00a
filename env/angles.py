"""Compass angles: degrees, clockwise from north (+y)."""

from __future__ import annotations

import math

from steerclear.shield.jit import lean_kernel


@lean_kernel
def wrap_bearing(angle_deg: float) -> float:
    """Wrap an angle in [-360, 360] into (-180, 180]; straight astern is +180, as in the reference simulator."""
    if angle_deg > 180.0:
        return angle_deg - 360.0
    if angle_deg <= -180.0:
        return angle_deg + 360.0
    return angle_deg


@lean_kernel
def heading_to(dx: float, dy: float) -> float:
    """Return the heading of (dx, dy), deg in [-180, 180]; the zero vector points east, as in the reference."""
    if dx == 0.0 and dy == 0.0:
        return 90.0
    return math.degrees(math.atan2(dx, dy))
