"""How near two boats come along sampled paths, and what a neighbour may do meanwhile.

A result is the row ``(margin, sample, nx, ny)``: least distance minus radius in m, the sample (with the fraction of
the way to the next) where it occurs, and the unit vector from the neighbour to the boat there.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel

MARGIN = 0
SAMPLE = 1
NORMAL_X = 2
NORMAL_Y = 3
N_CLEARANCE = 4

FAR = 1e6
"""Margin, m, of a pair that cannot meet."""


@lean_kernel
def _note(out: Array, best: float, x0: float, y0: float, x1: float, y1: float, k: int) -> float:
    """Least squared distance to the origin over a straight segment; noted in ``out`` when below ``best``."""
    dx, dy = x1 - x0, y1 - y0
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, -(x0 * dx + y0 * dy) / length))
    x, y = x0 + part * dx, y0 + part * dy
    square = x * x + y * y
    if square < best:
        out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = k - 1.0 + part, x, y
        return square
    return best


@lean_kernel
def _finish(out: Array, best: float, radius_m: float) -> None:
    """Turn squared distance and vector into margin and unit normal; coincident boats get the x axis."""
    distance = math.sqrt(best)
    out[MARGIN] = distance - radius_m
    if distance > 1e-9:
        out[NORMAL_X] /= distance
        out[NORMAL_Y] /= distance
    else:
        out[NORMAL_X], out[NORMAL_Y] = 1.0, 0.0


@lean_kernel
def _relative(own: Array, other: Array, x: float, y: float, sx: float, sy: float, k: int) -> tuple[float, float]:
    """Vector from the neighbour to the boat at sample k; ``other`` is its path, or empty for a straight course."""
    if other.shape[0] > 0:
        return own[k, 0] - other[k, 0], own[k, 1] - other[k, 1]
    return own[k, 0] - x - k * sx, own[k, 1] - y - k * sy


@lean_kernel
def clear_of_course(
    own: Array,
    other: Array,
    x: float,
    y: float,
    sx: float,
    sy: float,
    samples: int,
    tail: float,
    closing_m: float,
    radius_m: float,
    floor_m: float,
    cap_m: float,
    out: Array,
) -> None:
    """Clearance from a neighbour whose way is known: along a sampled path, or straight on.

    Samples that cannot bring the pair nearer than what is already known are skipped: in m samples the distance
    shrinks by at most m * ``closing_m``. The search stops once the margin is below ``floor_m``, and margins above
    ``cap_m`` are reported as ``cap_m``.

    Args:
        own: the boat's path, m.
        other: the neighbour's path, m, or an empty array (0, 2) for a straight course.
        x: straight course: position at sample 0, east, m.
        y: north, m.
        sx: movement per sample, east, m.
        sy: north, m.
        samples: last sample.
        tail: samples for which both run straight on afterwards.
        closing_m: most the distance can shrink per sample, m.
        radius_m: radius to keep, m.
        floor_m: margin below which the search stops, m.
        cap_m: margin above which nothing is looked at closely, m.
        out: the result row.
    """
    root = radius_m + cap_m
    best = root * root
    worth = (root + 2.0 * closing_m) * (root + 2.0 * closing_m)
    stop = max(0.0, floor_m + radius_m)
    stop *= stop
    out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = samples, 0.0, 0.0
    x0, y0 = _relative(own, other, x, y, sx, sy, 0)
    k = 0
    while True:
        square = x0 * x0 + y0 * y0
        if square > worth:
            k += int((math.sqrt(square) - root) / closing_m)
            if k >= samples:
                break
            x0, y0 = _relative(own, other, x, y, sx, sy, k)
            continue
        k += 1
        if k > samples:
            break
        x1, y1 = _relative(own, other, x, y, sx, sy, k)
        best = _note(out, best, x0, y0, x1, y1, k)
        if best < stop:
            break
        x0, y0 = x1, y1
    if best >= stop and tail > 0.0:
        x0, y0 = _relative(own, other, x, y, sx, sy, samples)
        reach = math.sqrt(best) + tail * closing_m
        if x0 * x0 + y0 * y0 < reach * reach:
            xb, yb = _relative(own, other, x, y, sx, sy, samples - 1)
            best = _note(out, best, x0, y0, x0 + tail * (x0 - xb), y0 + tail * (y0 - yb), samples)
    _finish(out, best, radius_m)
