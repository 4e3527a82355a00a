"""Clearance of two boats along sampled paths.

A result is the row ``(margin, sample, nx, ny)``: the least distance minus radius, m; the sample where it occurs, with
the fraction of the way to the next; and the unit vector from the neighbour to the boat there.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel

MARGIN, SAMPLE, NORMAL_X, NORMAL_Y = range(4)

FAR = 1e6
"""Margin, m, of a pair that cannot meet."""


@lean_kernel
def lower(out: Array, margin: float, k: int, nx: float, ny: float) -> None:
    """Note a margin at sample k, with the unit vector away from its source, if it is the least so far."""
    if margin < out[MARGIN]:
        out[MARGIN], out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = margin, k, nx, ny


@lean_kernel
def nearest_on(x0: float, y0: float, x1: float, y1: float) -> tuple[float, float, float]:
    """Find where a straight way comes nearest to the origin: the fraction of it until there, and that point, m."""
    dx, dy = x1 - x0, y1 - y0
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, -(x0 * dx + y0 * dy) / length))
    return part, x0 + part * dx, y0 + part * dy


@lean_kernel
def _note(out: Array, best: float, x0: float, y0: float, x1: float, y1: float, k: int) -> float:
    """Return the least squared distance over a leg, or ``best``; note it in ``out`` when below ``best``."""
    part, x, y = nearest_on(x0, y0, x1, y1)
    square = x * x + y * y
    if square < best:
        out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = k - 1.0 + part, x, y
        return square
    return best


@lean_kernel
def _relative(own: Array, other: Array, course: Array, way: float, k: int) -> tuple[float, float]:
    """Return the vector to the boat at sample k from the neighbour: on its path, or if that is empty on its course."""
    if other.shape[0] > 0:
        return own[k, 0] - other[k, 0], own[k, 1] - other[k, 1]
    return own[k, 0] - course[0] - k * (way * course[2]), own[k, 1] - course[1] - k * (way * course[3])


@lean_kernel
def clear_of_course(
    own: Array,
    other: Array,
    course: Array,
    way: float,
    samples: int,
    tail: float,
    search: tuple[float, ...],
    out: Array,
) -> None:
    """Find the clearance from a neighbour whose way is known.

    Samples that cannot bring the pair nearer than already found are skipped: in m samples the distance shrinks by at
    most m times what it can in one. The search stops once the margin is below its floor. Margins above the cap are
    reported as the cap.

    Args:
        own: the boat's path, m.
        other: the neighbour's path, m; empty, (0, 2), if it holds its course.
        course: (4,) then its position at sample 0, m, and its heading as a unit vector.
        way: and how far it goes between samples, m.
        samples: last sample.
        tail: samples for which both continue straight on afterwards.
        search: most the distance can shrink between samples, radius, floor and cap of margins, m.
        out: the result row.
    """
    closing_m, radius_m, floor_m, cap_m = search
    root = radius_m + cap_m
    best = root * root
    worth = (root + 2.0 * closing_m) * (root + 2.0 * closing_m)
    stop = max(0.0, floor_m + radius_m)
    stop *= stop
    out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = samples, 0.0, 0.0
    x0, y0 = _relative(own, other, course, way, 0)
    k = 0
    while True:
        square = x0 * x0 + y0 * y0
        if square > worth:
            k += int((math.sqrt(square) - root) / closing_m)
            if k >= samples:
                break
            x0, y0 = _relative(own, other, course, way, k)
            continue
        k += 1
        if k > samples:
            break
        x1, y1 = _relative(own, other, course, way, k)
        best = _note(out, best, x0, y0, x1, y1, k)
        if best < stop:
            break
        x0, y0 = x1, y1
    if best >= stop and tail > 0.0:
        x0, y0 = _relative(own, other, course, way, samples)
        reach = math.sqrt(best) + tail * closing_m
        if x0 * x0 + y0 * y0 < reach * reach:
            xb, yb = _relative(own, other, course, way, samples - 1)
            best = _note(out, best, x0, y0, x0 + tail * (x0 - xb), y0 + tail * (y0 - yb), samples)
    distance = math.sqrt(best)
    out[MARGIN] = distance - radius_m
    if distance > 1e-9:
        out[NORMAL_X] /= distance
        out[NORMAL_Y] /= distance
    else:
        out[NORMAL_X], out[NORMAL_Y] = 1.0, 0.0  # coincident boats
