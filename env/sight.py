"""Seeing points and straight lines from a boat: relative bearing (deg, clockwise, in (-180, 180]) and distance (m)."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, lean_kernel

from .angles import heading_to, wrap_bearing

START_X, START_Y, ALONG_X, ALONG_Y, LENGTH, TO_LEFT, TO_RIGHT = range(7)
"""Columns of a packed line: start, unit vector along it, length, headings perpendicular to it."""


def pack_lines(segments: Array) -> Array:
    """Segments (k, 2, 2), m, prepared for `sight_of_line`: (k, 7)."""
    rows = np.zeros((len(segments), 7))
    for row, (start, end) in zip(rows, segments, strict=True):
        length = float(np.linalg.norm(end - start))
        ux, uy = (end - start) / length
        row[:] = (*start, ux, uy, length, heading_to(-uy, ux), heading_to(uy, -ux))
    return rows


@lean_kernel
def sight_of_point(x: float, y: float, heading: float, point_x: float, point_y: float) -> tuple[float, float]:
    """Bearing and distance of a point, from (x, y) under ``heading``."""
    dx, dy = point_x - x, point_y - y
    return wrap_bearing(heading_to(dx, dy) - heading), math.sqrt(dx * dx + dy * dy)


@lean_kernel
def sight_of_line(x: float, y: float, heading: float, lines: Array, k: int) -> tuple[float, float]:
    """Bearing and distance of the closest point of packed line ``k``.

    Abreast of the line the direction is perpendicular to it and known beforehand: no arc tangent, and exact.
    """
    dx, dy = x - lines[k, START_X], y - lines[k, START_Y]
    along = dx * lines[k, ALONG_X] + dy * lines[k, ALONG_Y]
    to_right = dx * lines[k, ALONG_Y] - dy * lines[k, ALONG_X]
    if 0.0 < along < lines[k, LENGTH] and to_right != 0.0:
        towards = lines[k, TO_LEFT] if to_right > 0.0 else lines[k, TO_RIGHT]
        return wrap_bearing(towards - heading), abs(to_right)
    along = max(0.0, min(along, lines[k, LENGTH]))
    foot_x = lines[k, START_X] + along * lines[k, ALONG_X]
    foot_y = lines[k, START_Y] + along * lines[k, ALONG_Y]
    return sight_of_point(x, y, heading, foot_x, foot_y)
