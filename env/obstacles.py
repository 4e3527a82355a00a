"""Circular and polygonal obstacles: closest points and hits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.jit import Array, IntArray, lean_kernel

from .angles import heading_to

TOUCH_MARGIN_M = 1e-4
"""A boat touches an obstacle at this distance beyond its radius; guards against rounding."""


class Obstacles(NamedTuple):
    """Obstacles for compiled code, numbered with circles first, then polygons."""

    circles: Array  # (C, 3) radius, x, y, m
    edges: Array  # (E, 2, 2) all polygons' edges as segments, m
    edge_start: IntArray  # (P + 1,) index in ``edges`` where each polygon begins
    bounds: Array  # (C + P, 3) x, y, radius of a circle around each obstacle, m


def pack_obstacles(obstacles: Mapping[str, Any] | None) -> Obstacles:
    """Return the arrays of a config's (checked) obstacles."""
    circles = [] if obstacles is None else [(r, x, y) for r, (x, y) in obstacles["circle"]]
    polygons = [] if obstacles is None else [np.array(corners) for corners in obstacles["polygon"]]
    edges = [(p[i], p[(i + 1) % len(p)]) for p in polygons for i in range(len(p))]
    bounds = [(x, y, r) for r, x, y in circles]
    for polygon in polygons:
        middle = polygon.mean(axis=0)
        bounds.append((*middle, float(np.linalg.norm(polygon - middle, axis=1).max())))
    return Obstacles(
        circles=np.array(circles, dtype=np.float64).reshape(-1, 3),
        edges=np.array(edges, dtype=np.float64).reshape(-1, 2, 2),
        edge_start=np.cumsum([0] + [len(p) for p in polygons]).astype(np.int64),
        bounds=np.array(bounds, dtype=np.float64).reshape(-1, 3),
    )


@lean_kernel
def closest_on_segment(segment: Array, x: float, y: float) -> tuple[float, float]:
    """Return the point of a segment (2, 2) closest to (x, y), m."""
    ax, ay = segment[0, 0], segment[0, 1]
    dx, dy = segment[1, 0] - ax, segment[1, 1] - ay
    share = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
    if share <= 0.0:
        return ax, ay
    if share >= 1.0:
        return segment[1, 0], segment[1, 1]
    return ax + share * dx, ay + share * dy


@lean_kernel
def distance_and_heading(obstacles: Obstacles, number: int, x: float, y: float) -> tuple[float, float]:
    """Return the distance from (x, y) to an obstacle's edge, m (0 or less inside a circle), and the heading to it, deg.

    The heading is that to a circle's centre or to a polygon's closest point.
    """
    n_circles = obstacles.circles.shape[0]
    if number < n_circles:
        dx = obstacles.circles[number, 1] - x
        dy = obstacles.circles[number, 2] - y
        return math.sqrt(dx * dx + dy * dy) - obstacles.circles[number, 0], heading_to(dx, dy)
    nearest = np.inf
    near_dx, near_dy = 0.0, 0.0
    polygon = number - n_circles
    for e in range(obstacles.edge_start[polygon], obstacles.edge_start[polygon + 1]):
        px, py = closest_on_segment(obstacles.edges[e], x, y)
        distance = (px - x) * (px - x) + (py - y) * (py - y)
        if distance < nearest:
            nearest = distance
            near_dx, near_dy = px - x, py - y
    return math.sqrt(nearest), heading_to(near_dx, near_dy)


@lean_kernel
def touches_obstacle(obstacles: Obstacles, x: float, y: float, radius: float) -> bool:
    """Return whether a boat of this radius (m) at (x, y) touches any obstacle."""
    for number in range(obstacles.bounds.shape[0]):
        distance, _ = distance_and_heading(obstacles, number, x, y)
        if distance <= radius + TOUCH_MARGIN_M:
            return True
    return False
