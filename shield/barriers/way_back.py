"""The way back of a boat that is beyond something kept by rule: the field's edge, or a keep-out circle's.

However a path leads, such a boat does not keep the rule. What the path leads to tells paths apart: they are followed
straight on from their end, and those that lead back are worth most, even if they lead farther out at first, since lying
still outside is none. Of those, the one that goes out least.
"""

from __future__ import annotations

from ..jit import Array, lean_kernel

RETURN_S = 10.0
"""How long a path is followed straight on from its end, s,"""

PARTS = 5
"""and in how many parts."""

HOME_M = 1.0
"""A path that leads so far inside by then leads back, m."""

FARTHEST_M = 100.0
"""Boats farther outside are looked at as if they were that far, m: what tells their paths apart is the same."""

RETURN_WORTH = 0.01
"""What a metre that a path ends short of home counts beside a metre that the boat is outside now."""

DIP_WORTH = 0.002
"""What a metre counts by which it leads farther out at first: by 5 m as much as to stay just outside."""


@lean_kernel
def straight_on(path: Array, last: int, sample_s: float, on_s: float) -> tuple[float, float]:
    """Where a path leads so long after its end, m."""
    x, y = path[last, 0], path[last, 1]
    after = on_s / sample_s
    return x + after * (x - path[last - 1, 0]), y + after * (y - path[last - 1, 1])


@lean_kernel
def worth_of_way_back(now_m: float, least_m: float, most_m: float) -> float:
    """Clearance, m, negative, of a path of a boat that is outside.

    Args:
        now_m: margin of the constraint where the boat is, m, negative.
        least_m: least of it along the path, m.
        most_m: most of it on the way straight on from its end, m.
    """
    farther_m = max(0.0, -now_m - FARTHEST_M)
    short_m = max(0.0, HOME_M - most_m - farther_m)
    return now_m + farther_m - RETURN_WORTH * short_m - DIP_WORTH * max(0.0, now_m - least_m)
