"""Obstacles, which stop a boat: circles, and walls.

Samples of a path that cannot lower the clearance found so far are skipped: in m samples it shrinks by at most m times
the way the boat goes from sample to sample, its drift included. What a current of unknown direction may do to a boat is
a distance that grows with time: a clearance that is to hold is that much larger.

Who goes through a wall is behind it from there on, by as much as it is off it: from sample to sample a boat may go from
before a wall to behind it, and be near it at neither.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from ..scene import Boats, Static
from .clearance import FAR, MARGIN, lower

LEAVE_S = 0.5
"""Time constant with which a boat too near to an obstacle has to come away from it, s."""


@lean_kernel
def grace(boats: Boats, static: Static) -> float:
    """Factor per sample on what a boat too near to an obstacle is excused.

    Where there may be a current that is less than 1: asked only to come no nearer than it is, a boat would be carried
    in a little in every step.
    """
    return math.exp(-boats.sample_s / LEAVE_S) if static.current_mps > 0.0 else 1.0


@lean_kernel
def to_circle(x: float, y: float, circle: Array) -> tuple[float, float, float]:
    """Distance, m, from a circle (negative inside) and the unit vector away from it."""
    dx, dy = x - circle[0], y - circle[1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= 1e-9:
        return -circle[2], 1.0, 0.0
    return distance - circle[2], dx / distance, dy / distance


@lean_kernel
def _to_segment(x: float, y: float, segment: Array, hull_m: float) -> tuple[float, float, float]:
    """Distance, m, from what is within ``hull_m`` of a wall segment, and the unit vector away from it."""
    dx, dy = segment[2] - segment[0], segment[3] - segment[1]
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, ((x - segment[0]) * dx + (y - segment[1]) * dy) / length))
    rx, ry = x - segment[0] - part * dx, y - segment[1] - part * dy
    distance = math.sqrt(rx * rx + ry * ry)
    if distance <= 1e-9:
        return -hull_m, 1.0, 0.0
    return distance - hull_m, rx / distance, ry / distance


@lean_kernel
def _to_obstacle(x: float, y: float, o: int, static: Static) -> tuple[float, float, float]:
    """The same for obstacle number o: the circles come first, then the walls."""
    if o < static.circles.shape[0]:
        return to_circle(x, y, static.circles[o])
    return _to_segment(x, y, static.segments[o - static.circles.shape[0]], static.segment_m)


@lean_kernel
def _side(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """On which side of the line from a to b a point is: positive left, negative right."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@lean_kernel
def _through(x0: float, y0: float, x1: float, y1: float, o: int, static: Static) -> bool:
    """Whether the way from one point to another goes through obstacle number o, a wall; never through a circle."""
    if o < static.circles.shape[0]:
        return False
    ax, ay, bx, by = static.segments[o - static.circles.shape[0]]
    if (_side(x0, y0, ax, ay, bx, by) > 0.0) == (_side(x1, y1, ax, ay, bx, by) > 0.0):
        return False
    return (_side(ax, ay, x0, y0, x1, y1) > 0.0) != (_side(bx, by, x0, y0, x1, y1) > 0.0)


@lean_kernel
def clear_of_obstacles(
    here: Array,
    path: Array,
    samples: int,
    way_m: float,
    drift_m: float,
    grace: float,
    static: Static,
    most_m: float,
    out: Array,
) -> None:
    """Least clearance, m, of a path from circles and wall segments.

    A boat that is already too near to one has to come no nearer: its clearance there counts from where it is. With
    ``grace`` below 1 it has to come away as well: what it is short of now is excused less from sample to sample. Going
    through a wall is not excused, unless it is not known which side of it the boat is on.

    Args:
        here: where the boat is now, m, shape (>= 2,).
        path: positions from the next step on, m, shape (>= samples + 1, 2).
        samples: last sample.
        way_m: most the boat moves through the water from sample to sample, m.
        drift_m: most a current carries it meanwhile, m.
        grace: factor per sample on what is excused.
        static: the circles and walls, as they are to be kept.
        most_m: clearances beyond it are told as it, m.
        out: clearance row.
    """
    hull_m, circles = static.segment_m, static.circles.shape[0]
    out[MARGIN] = most_m
    for o in range(circles + static.segments.shape[0]):
        apart_m = _to_obstacle(here[0], here[1], o, static)[0]
        excused, known = min(0.0, apart_m), apart_m + hull_m >= static.side_m
        fall_m = way_m + drift_m - excused * (1.0 - grace)
        behind, x, y = False, here[0], here[1]
        k = 0
        while k <= samples:
            margin, nx, ny = _to_obstacle(path[k, 0], path[k, 1], o, static)
            near_m = FAR if o < circles else margin + hull_m  # a wall farther off is not gone through
            if known and _through(x, y, path[k, 0], path[k, 1], o, static):
                behind = not behind
            if behind:
                margin, nx, ny = -near_m - hull_m - k * drift_m, -nx, -ny
            else:
                margin -= excused * grace**k + k * drift_m
            lower(out, margin, k, nx, ny)
            x, y = path[k, 0], path[k, 1]
            k += max(1, int(min(margin - out[MARGIN], near_m) / fall_m))
