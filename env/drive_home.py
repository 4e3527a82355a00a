"""Commands that every boat will obey, decided before anything moves; the game itself steers some boats.

The game steers a tagged boat straight to its own flag's home, or to the nearer corner of its side.
`heading_past_obstacles` leads it past obstacles. It steers an out-of-bounds boat straight off the nearest edge. A
disabled boat gets speed 0 and coasts.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, kernel, lean_kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to, wrap_bearing
from .arrays import Games, Rules
from .obstacles import Obstacles, closest_on_segment, distance_and_heading, touches_obstacle


@lean_kernel
def heading_into_field(size: Array, x: float, y: float) -> float:
    """Return the heading perpendicular to the edge nearest to (x, y), pointing inwards, deg."""
    over_x = max(0.0, -x, x - size[0])
    over_y = max(0.0, -y, y - size[1])
    south = math.hypot(y, over_x)
    east = math.hypot(size[0] - x, over_y)
    north = math.hypot(size[1] - y, over_x)
    west = math.hypot(x, over_y)
    nearest = min(min(south, east), min(north, west))
    if south == nearest:
        return 0.0
    if east == nearest:
        return -90.0
    if north == nearest:
        return 180.0
    return 90.0


@lean_kernel
def nearer_mark(marks: Array, x: float, y: float) -> int:
    """Return which of two marks (2, 2), m, is nearer to (x, y): 0 or 1; 0 on a tie."""
    first = math.sqrt((marks[0, 0] - x) ** 2 + (marks[0, 1] - y) ** 2)
    second = math.sqrt((marks[1, 0] - x) ** 2 + (marks[1, 1] - y) ** 2)
    return 1 if second < first else 0


@lean_kernel
def _drive(rules: Rules, games: Games, b: int, i: int, command: Array) -> None:
    """Command a boat that is tagged or out of bounds: speed m/s, relative heading deg."""
    x, y = games.state[b, i, L.X], games.state[b, i, L.Y]
    if games.is_tagged[b, i]:
        home = rules.flag_home[rules.team[i]]
        if rules.untag_at_corner:
            marks = rules.corner_marks[rules.team[i]]
            home = marks[nearer_mark(marks, x, y)]
        if rules.obstacles.bounds.shape[0] > 0:
            heading = heading_past_obstacles(rules.obstacles, rules.agent_radius[i], x, y, home)
        else:
            heading = heading_to(home[0] - x, home[1] - y)
    else:
        heading = heading_into_field(rules.size, x, y)
    share = rules.oob_speed_frac if games.oob[b, i] else 1.0
    if games.is_tagged[b, i] and rules.tag_speed_frac < 1.0:
        share = min(share, rules.tag_speed_frac)
    command[0] = rules.max_speed[i] * share
    command[1] = wrap_bearing(heading - games.state[b, i, L.HEADING])


@lean_kernel
def decide_boat(rules: Rules, games: Games, actions: Array, commands: Array, b: int, i: int) -> None:
    """Fill one boat's row of ``commands`` with what it will obey, and ``games.driven``."""
    state = games.state[b, i]
    games.driven[b, i] = True
    on_obstacle = rules.obstacles.bounds.shape[0] > 0 and touches_obstacle(
        rules.obstacles, state[L.X], state[L.Y], rules.agent_radius[i]
    )
    if on_obstacle or games.is_disabled[b, i]:
        commands[b, i, 0] = 0.0
        commands[b, i, 1] = 0.0
    elif games.is_tagged[b, i] or games.oob[b, i]:
        _drive(rules, games, b, i, commands[b, i])
    else:
        games.driven[b, i] = False
        # the reference passes policies' commands to the autopilot in single precision
        commands[b, i, 0] = np.float32(actions[b, i, 0])
        commands[b, i, 1] = np.float32(actions[b, i, 1])


@lean_kernel
def decide_games(rules: Rules, games: Games, actions: Array, commands: Array, first: int, last: int) -> None:
    """Run `decide_commands` for the games first..last-1."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            decide_boat(rules, games, actions, commands, b, i)


@lean_kernel
def decide_commands(rules: Rules, games: Games, actions: Array, commands: Array) -> None:
    """Fill ``commands`` (B, n, 2) with what the boats will obey; ``actions`` are the policies' nominal commands.

    Units are m/s and relative heading deg. Of the games only ``driven`` is written.
    """
    decide_games(rules, games, actions, commands, 0, games.state.shape[0])


CLEARANCE_M = 1.0
"""Distance beyond its radius at which a boat passes an obstacle."""


@kernel
def _side_of(segment: Array, x: float, y: float) -> float:
    """Return a positive number left of a segment's line, a negative one right of it."""
    along_x, along_y = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    return along_x * (y - segment[0, 1]) - along_y * (x - segment[0, 0])


@kernel
def _gap(one: Array, two: Array) -> float:
    """Return the distance between two segments (2, 2), m; 0 if they cross."""
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
    """Return whether the straight ``way`` (2, 2) passes an obstacle closer than ``room_m``."""
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
    """Return half the angle under which a circle is seen, deg; 90 from inside."""
    return 90.0 if distance_m <= radius_m else math.degrees(math.asin(radius_m / distance_m))


@kernel
def _extent(obstacles: Obstacles, number: int, x: float, y: float, room_m: float) -> tuple[float, float, float]:
    """Return the heading to an obstacle's middle, and how far it extends left (< 0) and right (> 0) of it, deg."""
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
    """Return the heading, deg, for a boat at (x, y) to a goal (x, y) past obstacles. It is not wrapped."""
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
