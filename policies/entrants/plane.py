"""Plane geometry of the entrants: headings, meeting points, crossing paths, stations and their assignment."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .observation import Boat, Observation, Point

Order = tuple[float, float]
"""Speed m/s and absolute heading rad in the own-end frame."""
STOP_MPS = 0.0
GAP_M = 9.0
"""Distance between neighbouring stations: more than the largest collision radius of the presets."""
SLOWING_M, SLOWEST = 10.0, 0.25
"""Distance within which a boat slows down before a point, m, and the least share of its top speed there."""


def distance(a: Point, b: Point) -> float:
    """Return the distance from a to b, m."""
    return math.hypot(b[0] - a[0], b[1] - a[1])


def heading_to(a: Point, b: Point) -> float:
    """Return the heading from a to b, rad clockwise from north."""
    return math.atan2(b[0] - a[0], b[1] - a[1])


def ahead(a: Point, heading: float, way: float) -> Point:
    """Return the point ``way`` metres from a along a heading."""
    return a[0] + way * math.sin(heading), a[1] + way * math.cos(heading)


def wrap(angle: float) -> float:
    """Wrap an angle into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def clip(value: float, low: float, high: float) -> float:
    """Limit a value to [low, high]."""
    return min(max(value, low), high)


def go(boat: Boat, point: Point, near_m: float = 2.0) -> Order:
    """Steer to a point: full speed, slower within `SLOWING_M` (fast boats circle near points), a stop at ``near_m``."""
    towards, way_m = heading_to(boat.at, point), distance(boat.at, point)
    if way_m <= near_m:
        return STOP_MPS, boat.heading
    return boat.top * clip(way_m / SLOWING_M, SLOWEST, 1.0), towards


def dock(boat: Boat, obs: Observation) -> Point | None:
    """Return the nearest place where the flag must be brought; None if reaching the own side is enough."""
    return min(obs.docks, key=lambda point: distance(boat.at, point), default=None)


def meeting_point(hunter: Boat, target: Boat) -> Point:
    """Return where a boat at full speed first meets a target on a straight course.

    It solves |p + v t - q| = V t for the least t >= 0, a quadratic in t. Without a solution it returns the target's
    place.
    """
    (vx, vy), px, py = target.velocity, target.x - hunter.x, target.y - hunter.y
    a, b, c = vx * vx + vy * vy - hunter.top**2, px * vx + py * vy, px * px + py * py
    if abs(a) < 1e-9:
        times = [-c / (2.0 * b)] if b < -1e-9 else []
    else:
        root = b * b - a * c
        times = [(-b + sign * math.sqrt(root)) / a for sign in (1.0, -1.0)] if root >= 0.0 else []
    soonest = min((t for t in times if t >= 0.0), default=0.0)
    return target.x + vx * soonest, target.y + vy * soonest


def cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the paths from a to b and from c to d cross."""

    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0


def arc(obs: Observation) -> list[Point]:
    """Return a station per own boat, on the grab-radius circle round the own flag, on the side of the dividing line."""
    radius = max(obs.reach, obs.keepout + max(boat.radius for boat in obs.own) + 1.0)
    step = 2.0 * math.asin(min(GAP_M / (2.0 * radius), 1.0))
    first = 0.5 * math.pi - 0.5 * step * (len(obs.own) - 1)
    return [ahead(obs.home, first + k * step, radius) for k in range(len(obs.own))]


def row(obs: Observation) -> list[Point]:
    """Return a station per own boat, in a row across the own half midway to the dividing line.

    These are the presets' start places.
    """
    x, gap = 0.5 * (obs.home[0] + obs.line), obs.size[1] / (len(obs.own) + 1)
    return [(x, gap * (k + 1)) for k in range(len(obs.own))]


def assign(starts: Sequence[Point], ends: Sequence[Point]) -> list[int]:
    """Assign ends to starts with the least sum of distances; return each start's end, -1 if ends are fewer."""
    costs = np.array([[distance(a, b) for b in ends] for a in starts])
    chosen = [-1] * len(starts)
    from scipy.optimize import linear_sum_assignment  # importing it takes a while

    for start, end in zip(*linear_sum_assignment(costs), strict=True):
        chosen[int(start)] = int(end)
    return chosen
