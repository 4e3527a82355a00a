"""Things that do not move: obstacles, which stop a boat, and field edge and keep-out circles, which are rules.

Samples of a path that cannot lower the clearance found so far are skipped: in m samples it shrinks by at most m times
the way the boat goes from sample to sample, its drift included. What a current of unknown direction may do to a boat is
a distance that grows with time: a clearance that is to hold is that much larger.

Who goes through a wall is behind it from there on, by as much as it is off it: from sample to sample a boat may go from
before a wall to behind it, and be near it at neither.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from ..scene import Fixed
from .clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE

RETURN_S = 10.0
"""How long a boat outside the field is followed straight on from the end of its path, s."""

HOME_M = 1.0
"""A path that leads so far inside by then leads back, m."""

FARTHEST_M = 100.0
"""Boats farther outside are looked at as if they were that far, m: what tells their paths apart is the same."""

RETURN_WORTH = 0.01
"""What a metre of a path outside the field counts beside a metre that the boat is outside now."""


@lean_kernel
def _lower(out: Array, margin: float, k: int, nx: float, ny: float) -> None:
    if margin < out[MARGIN]:
        out[MARGIN], out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = margin, k, nx, ny


@lean_kernel
def _inside(side: int, x: float, y: float, field: Array) -> float:
    """How far inside one side of a rectangle (left, low, right, high) a point is, m; infinite where there is none."""
    at = x if side % 2 == 0 else y
    return at - field[side] if side < 2 else field[side] - at


@lean_kernel
def _within(side: int, path: Array, samples: int, drift_m: float, field: Array, out: Array) -> None:
    """Distance inside a side along a path, less the drift until then."""
    nx, ny = _inwards(side)
    for k in range(samples + 1):
        _lower(out, _inside(side, path[k, 0], path[k, 1], field) - k * drift_m, k, nx, ny)


@lean_kernel
def _inwards(side: int) -> tuple[float, float]:
    """Unit vector away from a side."""
    sign = 1.0 if side < 2 else -1.0
    return (sign, 0.0) if side % 2 == 0 else (0.0, sign)


@lean_kernel
def _way_back(side: int, here: Array, path: Array, last: int, sample_s: float, field: Array, out: Array) -> None:
    """The same of a boat that is beyond that side: how far, and a trifle for where the path leads.

    It is followed straight on from its end. One that leads back is worth most, even if it leads farther out at first:
    lying still outside is none. Of those that lead back, the one that goes out least.
    """
    x, y = path[last, 0], path[last, 1]
    after = RETURN_S / sample_s
    end_m = _inside(side, x + after * (x - path[last - 1, 0]), y + after * (y - path[last - 1, 1]), field)
    now_m, least_m = _inside(side, here[0], here[1], field), FAR
    for k in range(last + 1):
        least_m = min(least_m, _inside(side, path[k, 0], path[k, 1], field))
    farther_m = max(0.0, -now_m - FARTHEST_M)
    short_m = max(0.0, HOME_M - end_m - farther_m)
    nx, ny = _inwards(side)
    _lower(out, now_m + farther_m - RETURN_WORTH * (short_m + max(0.0, now_m - least_m)), last, nx, ny)


@lean_kernel
def _to_circle(x: float, y: float, circle: Array) -> tuple[float, float, float]:
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
def _to_obstacle(x: float, y: float, o: int, fixed: Fixed) -> tuple[float, float, float]:
    """The same for obstacle number o: the circles come first, then the walls."""
    if o < fixed.circles.shape[0]:
        return _to_circle(x, y, fixed.circles[o])
    return _to_segment(x, y, fixed.segments[o - fixed.circles.shape[0]], fixed.segment_m)


@lean_kernel
def _side(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """On which side of the line from a to b a point is: positive left, negative right."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@lean_kernel
def _through(x0: float, y0: float, x1: float, y1: float, o: int, fixed: Fixed) -> bool:
    """Whether the way from one point to another goes through obstacle number o, a wall; never through a circle."""
    if o < fixed.circles.shape[0]:
        return False
    ax, ay, bx, by = fixed.segments[o - fixed.circles.shape[0]]
    if (_side(x0, y0, ax, ay, bx, by) > 0.0) == (_side(x1, y1, ax, ay, bx, by) > 0.0):
        return False
    return (_side(ax, ay, x0, y0, x1, y1) > 0.0) != (_side(bx, by, x0, y0, x1, y1) > 0.0)


@lean_kernel
def clear_of_rules(
    here: Array,
    path: Array,
    near_samples: int,
    samples: int,
    fixed: Fixed,
    way_m: float,
    drift_m: float,
    sample_s: float,
    out: Array,
) -> None:
    """Least clearance, m, of a path from the field edge and from circles kept by rule.

    The edge is looked at only until a half turn could be over, since every straight run ends beyond it. A boat that is
    beyond it has to come back, see `_way_back`.

    Args:
        here: where the boat is now, m, shape (>= 2,).
        path: positions, m, shape (>= samples + 1, 2).
        near_samples: last sample at which the edge counts.
        samples: last sample.
        fixed: the edge and the circles, as they are to be kept.
        way_m: most the boat moves through the water from sample to sample, m.
        drift_m: most a current carries it meanwhile, m.
        sample_s: time from sample to sample, s.
        out: clearance row.
    """
    out[MARGIN] = FAR
    for side in range(4):
        if _inside(side, here[0], here[1], fixed.field) < 0.0:
            _way_back(side, here, path, samples, sample_s, fixed.field, out)
        else:
            _within(side, path, near_samples, drift_m, fixed.field, out)
    for c in range(fixed.keep_out.shape[0]):
        k = 0
        while k <= samples:
            margin, nx, ny = _to_circle(path[k, 0], path[k, 1], fixed.keep_out[c])
            margin -= k * drift_m
            _lower(out, margin, k, nx, ny)
            k += max(1, int((margin - out[MARGIN]) / (way_m + drift_m)))


@lean_kernel
def clear_of_obstacles(
    here: Array,
    path: Array,
    samples: int,
    way_m: float,
    drift_m: float,
    grace: float,
    fixed: Fixed,
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
        fixed: the circles and walls, as they are to be kept.
        out: clearance row.
    """
    hull_m, circles = fixed.segment_m, fixed.circles.shape[0]
    out[MARGIN] = FAR
    for o in range(circles + fixed.segments.shape[0]):
        apart_m = _to_obstacle(here[0], here[1], o, fixed)[0]
        excused, known = min(0.0, apart_m), apart_m + hull_m >= fixed.side_m
        fall_m = way_m + drift_m - excused * (1.0 - grace)
        behind, x, y = False, here[0], here[1]
        k = 0
        while k <= samples:
            margin, nx, ny = _to_obstacle(path[k, 0], path[k, 1], o, fixed)
            near_m = FAR if o < circles else margin + hull_m  # a wall farther off is not gone through
            if known and _through(x, y, path[k, 0], path[k, 1], o, fixed):
                behind = not behind
            if behind:
                margin, nx, ny = -near_m - hull_m - k * drift_m, -nx, -ny
            else:
                margin -= excused * grace**k + k * drift_m
            _lower(out, margin, k, nx, ny)
            x, y = path[k, 0], path[k, 1]
            k += max(1, int(min(margin - out[MARGIN], near_m) / fall_m))


@lean_kernel
def first_touch(
    here: Array,
    path: Array,
    samples: int,
    way_m: float,
    drift_m: float,
    grace: float,
    fixed: Fixed,
) -> int:
    """First sample of a path that is too near to an obstacle, ``samples + 1`` for none; arguments as above."""
    first = samples + 1
    for o in range(fixed.circles.shape[0] + fixed.segments.shape[0]):
        apart_m = _to_obstacle(here[0], here[1], o, fixed)[0]
        excused, known = min(0.0, apart_m), apart_m + fixed.segment_m >= fixed.side_m
        fall_m = way_m + drift_m - excused * (1.0 - grace)
        x, y = here[0], here[1]
        k = 0
        while k < first:
            margin = _to_obstacle(path[k, 0], path[k, 1], o, fixed)[0]
            margin -= excused * grace**k + k * drift_m
            if margin < 0.0 or (known and _through(x, y, path[k, 0], path[k, 1], o, fixed)):
                first = k
            x, y = path[k, 0], path[k, 1]
            k += max(1, int(margin / fall_m))
    return first
