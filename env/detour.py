"""A heading to a goal past obstacles: straight on, or along the edge of the nearest obstacle in the way.

Enough for obstacles that do not form traps, and the same for every seed. The reference plans with RRT* here.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, kernel

from .angles import heading_to, wrap_bearing
from .obstacles import Obstacles, closest_on_segment, distance_and_heading

CLEARANCE_M = 1.0
"""How much wider than its radius a boat passes an obstacle."""


@kernel
def _side_of(segment: Array, x: float, y: float) -> float:
    """Positive left of a segment's line, negative right of it."""
    along_x, along_y = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    return along_x * (y - segment[0, 1]) - along_y * (x - segment[0, 0])


@kernel
def _gap(one: Array, two: Array) -> float:
    """Distance between two segments (2, 2), m; 0 when they cross."""
    crosses_one = _side_of(one, two[0, 0], two[0, 1]) * _side_of(one, two[1, 0], two[1, 1]) < 0.0
    crosses_two = _side_of(two, one[0, 0], one[0, 1]) * _side_of(two, one[1, 0], one[1, 1]) < 0.0
    if crosses_one and crosses_two:
        return 0.0
    gap = np.inf
    for end in range(2):
        x, y = closest_on_segment(one, two[end, 0], two[end, 1])
        gap = min(gap, math.hypot(x - two[end, 0], y - two[end, 1]))
        x, y = closest_on_segment(two, one[end, 0], one[end, 1])
        gap = min(gap, math.hypot(x - one[end, 0], y - one[end, 1]))
    return gap


@kernel
def _is_in_the_way(obstacles: Obstacles, number: int, way: Array, room_m: float) -> bool:
    """Whether the straight ``way`` (2, 2) passes an obstacle closer than ``room_m``."""
    n_circles = obstacles.circles.shape[0]
    if number < n_circles:
        centre_x, centre_y = obstacles.circles[number, 1], obstacles.circles[number, 2]
        x, y = closest_on_segment(way, centre_x, centre_y)
        return math.hypot(x - centre_x, y - centre_y) < obstacles.circles[number, 0] + room_m
    polygon = number - n_circles
    for e in range(obstacles.edge_start[polygon], obstacles.edge_start[polygon + 1]):
        if _gap(way, obstacles.edges[e]) < room_m:
            return True
    return False


@kernel
def _half_angle(radius_m: float, distance_m: float) -> float:
    """Half the angle under which a circle is seen, deg; 90 from inside."""
    return 90.0 if distance_m <= radius_m else math.degrees(math.asin(radius_m / distance_m))


@kernel
def _extent(obstacles: Obstacles, number: int, x: float, y: float, room_m: float) -> tuple[float, float, float]:
    """Heading to an obstacle's middle and how far it reaches to the left (< 0) and right (> 0) of that, deg."""
    bounds = obstacles.bounds[number]
    middle = heading_to(bounds[0] - x, bounds[1] - y)
    n_circles = obstacles.circles.shape[0]
    if number < n_circles:
        half = _half_angle(bounds[2] + room_m, math.hypot(bounds[0] - x, bounds[1] - y))
        return middle, -half, half
    left, right = 0.0, 0.0
    polygon = number - n_circles
    for e in range(obstacles.edge_start[polygon], obstacles.edge_start[polygon + 1]):
        dx, dy = obstacles.edges[e, 0, 0] - x, obstacles.edges[e, 0, 1] - y
        offset = wrap_bearing(heading_to(dx, dy) - middle)
        half = _half_angle(room_m, math.hypot(dx, dy))
        left = min(left, offset - half)
        right = max(right, offset + half)
    return middle, left, right


@kernel
def heading_past_obstacles(obstacles: Obstacles, radius_m: float, x: float, y: float, goal: Array) -> float:
    """Heading, deg, for a boat of that radius at (x, y) to a goal (x, y); not brought into half a turn either way."""
    straight = heading_to(goal[0] - x, goal[1] - y)
    if x == goal[0] and y == goal[1]:
        return straight
    way = np.array([[x, y], [goal[0], goal[1]]])
    room = radius_m + CLEARANCE_M
    heading, nearest = straight, np.inf
    for number in range(obstacles.bounds.shape[0]):
        distance, _ = distance_and_heading(obstacles, number, x, y)
        if distance < nearest and _is_in_the_way(obstacles, number, way, room):
            middle, left, right = _extent(obstacles, number, x, y, room)
            aside = wrap_bearing(straight - middle)
            if left < aside < right:
                nearest = distance
                heading = middle + (right if right - aside <= aside - left else left)
    return heading
