"""How near two boats come along sampled paths, and what a neighbour may do meanwhile.

A result is the row ``(margin, sample, nx, ny)``: least distance minus radius in m, the sample (with the fraction of
the way to the next) where it occurs, and the unit vector from the neighbour to the boat there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..jit import Array, lean_kernel

MARGIN = 0
SAMPLE = 1
NORMAL_X = 2
NORMAL_Y = 3
N_CLEARANCE = 4

FAR = 1e6
"""Margin, m, of a pair that cannot meet."""


class Course(NamedTuple):
    """Where a neighbour goes whose way is known: along a sampled path, or straight on.

    Attributes:
        path: its positions, m, shape (samples, 2); empty, (0, 2), for a straight course.
        x: straight course: position at sample 0, east, m.
        y: north, m.
        step_x: movement from sample to sample, east, m.
        step_y: north, m.
    """

    path: Array
    x: float
    y: float
    step_x: float
    step_y: float


class Search(NamedTuple):
    """How closely a clearance is looked at.

    Attributes:
        closing_m: most the distance can shrink from sample to sample, m.
        radius_m: radius to keep, m.
        floor_m: margin below which the search stops, m.
        cap_m: margin above which nothing is looked at closely, m.
    """

    closing_m: float
    radius_m: float
    floor_m: float
    cap_m: float


class Leg(NamedTuple):
    """A straight way from (x0, y0) to (x1, y1) as seen from a neighbour, m."""

    x0: float
    y0: float
    x1: float
    y1: float


@lean_kernel
def lower(out: Array, margin: float, k: int, nx: float, ny: float) -> None:
    """Note a margin at sample k, with the unit vector away from what it is from, where it is the least."""
    if margin < out[MARGIN]:
        out[MARGIN], out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = margin, k, nx, ny


@lean_kernel
def nearest_on(leg: Leg) -> tuple[float, float, float]:
    """Where a leg comes nearest to the neighbour: the part of it until then, and the place, m."""
    dx, dy = leg.x1 - leg.x0, leg.y1 - leg.y0
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, -(leg.x0 * dx + leg.y0 * dy) / length))
    return part, leg.x0 + part * dx, leg.y0 + part * dy


@lean_kernel
def _note(out: Array, best: float, leg: Leg, k: int) -> float:
    """Least squared distance over a leg; noted in ``out`` when below ``best``."""
    part, x, y = nearest_on(leg)
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
def _relative(own: Array, course: Course, k: int) -> tuple[float, float]:
    """Vector from the neighbour to the boat at sample k."""
    if course.path.shape[0] > 0:
        return own[k, 0] - course.path[k, 0], own[k, 1] - course.path[k, 1]
    return own[k, 0] - course.x - k * course.step_x, own[k, 1] - course.y - k * course.step_y


@lean_kernel
def clear_of_course(own: Array, course: Course, samples: int, tail: float, search: Search, out: Array) -> None:
    """Clearance from a neighbour whose way is known.

    Samples that cannot bring the pair nearer than what is already known are skipped: in m samples the distance
    shrinks by at most m * ``closing_m``. The search stops once the margin is below ``floor_m``, and margins above
    ``cap_m`` are reported as ``cap_m``.

    Args:
        own: the boat's path, m.
        course: the neighbour's way.
        samples: last sample.
        tail: samples for which both run straight on afterwards.
        search: how closely it is looked at.
        out: the result row.
    """
    closing_m, radius_m = search.closing_m, search.radius_m
    root = radius_m + search.cap_m
    best = root * root
    worth = (root + 2.0 * closing_m) * (root + 2.0 * closing_m)
    stop = max(0.0, search.floor_m + radius_m)
    stop *= stop
    out[SAMPLE], out[NORMAL_X], out[NORMAL_Y] = samples, 0.0, 0.0
    x0, y0 = _relative(own, course, 0)
    k = 0
    while True:
        square = x0 * x0 + y0 * y0
        if square > worth:
            k += int((math.sqrt(square) - root) / closing_m)
            if k >= samples:
                break
            x0, y0 = _relative(own, course, k)
            continue
        k += 1
        if k > samples:
            break
        x1, y1 = _relative(own, course, k)
        best = _note(out, best, Leg(x0, y0, x1, y1), k)
        if best < stop:
            break
        x0, y0 = x1, y1
    if best >= stop and tail > 0.0:
        x0, y0 = _relative(own, course, samples)
        reach = math.sqrt(best) + tail * closing_m
        if x0 * x0 + y0 * y0 < reach * reach:
            xb, yb = _relative(own, course, samples - 1)
            best = _note(out, best, Leg(x0, y0, x0 + tail * (x0 - xb), y0 + tail * (y0 - yb)), samples)
    _finish(out, best, radius_m)
