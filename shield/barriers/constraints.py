"""Static constraints and registered barriers by number, each a margin and a slope by place and time.

First come those that stop a boat: circles, walls, registered barriers; then those kept by rule: keep-out circles, and
the sides of the field. The number after the last stands for the field as one, which a boat outside comes back into.
"""

from __future__ import annotations

from ..jit import lean_kernel
from ..scene import Registered, Static
from .circles import to_circle
from .edge import to_rectangle, to_side
from .registered import margin_of
from .walls import to_wall

SIDES = 4
"""Sides of a field: the last numbers."""


@lean_kernel
def count_built_in(static: Static) -> int:
    """How many of those that stop a boat are circles and walls; registered barriers come next."""
    return static.circles.shape[0] + static.segments.shape[0]


@lean_kernel
def count_obstacles(static: Static, registered: Registered) -> int:
    """How many stop a boat."""
    return count_built_in(static) + registered.address.shape[0]


@lean_kernel
def count_all(static: Static, registered: Registered) -> int:
    """How many there are."""
    return count_obstacles(static, registered) + static.keep_out.shape[0] + SIDES


@lean_kernel
def registered_number(o: int, static: Static, registered: Registered) -> int:
    """Which registered barrier number o is, -1: none."""
    b = o - count_built_in(static)
    return b if 0 <= b < registered.address.shape[0] else -1


@lean_kernel
def wall_number(o: int, static: Static) -> int:
    """Which wall number o is, -1: none."""
    w = o - static.circles.shape[0]
    return w if 0 <= w < static.segments.shape[0] else -1


@lean_kernel
def margin_at(
    o: int, x: float, y: float, ahead_s: float, static: Static, registered: Registered
) -> tuple[float, float, float]:
    """Margin, m, of constraint number o at a place so long from now, and its slope.

    The slope of registered barriers is told as 0: it is asked for only where it is needed, see
    `registered.write_slope`.
    """
    if o < static.circles.shape[0]:
        return to_circle(x, y, static.circles[o])
    if o < count_built_in(static):
        return to_wall(x, y, static.segments[wall_number(o, static)], static.segment_m)
    if o < count_obstacles(static, registered):
        return margin_of(registered_number(o, static, registered), x, y, ahead_s, registered), 0.0, 0.0
    rule = o - count_obstacles(static, registered)
    if rule < static.keep_out.shape[0]:
        return to_circle(x, y, static.keep_out[rule])
    if rule == static.keep_out.shape[0] + SIDES:
        return to_rectangle(x, y, static.field)
    return to_side(x, y, rule - static.keep_out.shape[0], static.field)
