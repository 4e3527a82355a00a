"""Boats that steer to points (fixed paths, given or random waypoints, a random walk), and the rammer.

The rammer pursues the nearest boat with lead; it is the reference adversary for every shield.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.env.randomness import next_uniform
from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L

from .layout import (
    GOAL,
    GOAL_X,
    GOAL_Y,
    HEIGHT,
    HELD_HEADING,
    HELD_SPEED,
    HIT_TEAM_MATES,
    KEEPOUT,
    MAX_SPEED,
    RADIUS,
    REACHED,
    SPEED_FRACTION,
    STEP,
    TIME_LEFT,
    WIDTH,
    Game,
    bearing_deg,
    own_end_point,
    to_boat,
    wrap_deg,
)

DEFENCE_PATROL = ((0.375, 0.75), (0.375, 0.25))  # own-end fractions, in front of the base, port then starboard
PATROL_REACHED_M = 2.5
WAYPOINT_REACHED_M = 3.0
WAYPOINT_TIMEOUT_S = 60.0
WALL_MARGIN_M = 5.0
HOLD_MIN_S, HOLD_MAX_S = 1.0, 5.0
LEAD_LIMIT_S = 30.0


@lean_kernel
def follow(game: Game, boat: int, x_m: float, y_m: float) -> tuple[float, float]:
    """Steer to a point at full speed; stop within the boat's own radius of it."""
    right, forward = to_boat(game, boat, x_m, y_m)
    speed = 0.0 if math.hypot(right, forward) <= game.limits[boat, RADIUS] else game.limits[boat, MAX_SPEED]
    return speed, bearing_deg(right, forward)


@lean_kernel
def easy_defend(game: Game, boat: int, memory: Array) -> tuple[float, float]:
    """Patrol between two points in front of the own base at full speed."""
    goal = int(memory[GOAL])
    for _ in range(2):
        along, across = DEFENCE_PATROL[goal]
        x, y = own_end_point(game, game.team[boat], along, across)
        if math.hypot(x - game.state[boat, L.X], y - game.state[boat, L.Y]) > PATROL_REACHED_M:
            break
        goal = 1 - goal
    memory[GOAL] = goal
    return follow(game, boat, x, y)


@lean_kernel
def waypoints(
    game: Game, boat: int, memory: Array, given: Array, streams: np.ndarray, slot: int
) -> tuple[float, float]:
    """Steer from waypoint to waypoint: the given ones in turn, or random ones if ``given`` is empty.

    A waypoint not reached in ``WAYPOINT_TIMEOUT_S`` is skipped, so that a boat cannot circle one for ever.
    """
    x, y = game.state[boat, L.X], game.state[boat, L.Y]
    memory[TIME_LEFT] -= game.field[STEP]
    started = memory[GOAL] > 0.0
    arrived = started and math.hypot(memory[GOAL_X] - x, memory[GOAL_Y] - y) <= WAYPOINT_REACHED_M
    if arrived:
        memory[REACHED] += 1.0
    if arrived or not started or memory[TIME_LEFT] <= 0.0:
        next_waypoint(game, boat, memory, given, streams, slot)
    right, forward = to_boat(game, boat, memory[GOAL_X], memory[GOAL_Y])
    return game.field[SPEED_FRACTION] * game.limits[boat, MAX_SPEED], bearing_deg(right, forward)


@lean_kernel
def next_waypoint(game: Game, boat: int, memory: Array, given: Array, streams: np.ndarray, slot: int) -> None:
    """Write the next waypoint into the memory row."""
    if given.shape[0] > 0:
        number = int(memory[GOAL]) % given.shape[0]
        memory[GOAL_X], memory[GOAL_Y] = given[number, 0], given[number, 1]
    else:
        memory[GOAL_X], memory[GOAL_Y] = random_point(game, boat, streams, slot)
    memory[GOAL] += 1.0
    memory[TIME_LEFT] = WAYPOINT_TIMEOUT_S


@lean_kernel
def random_point(game: Game, boat: int, streams: np.ndarray, slot: int) -> tuple[float, float]:
    """Draw a point uniformly in the field, off the walls and outside the own flag's keep-out."""
    home = game.flag_home[game.team[boat]]
    clear_m = game.field[KEEPOUT] + game.limits[boat, RADIUS] + WAYPOINT_REACHED_M
    x = y = 0.0
    for _ in range(20):
        x = spread(next_uniform(streams, slot), game.field[WIDTH])
        y = spread(next_uniform(streams, slot), game.field[HEIGHT])
        if math.hypot(x - home[0], y - home[1]) > clear_m:
            break
    return x, y


@lean_kernel
def spread(fraction: float, length_m: float) -> float:
    """Return the point at ``fraction`` between the two wall margins; the middle of a field too narrow for margins."""
    margin = min(WALL_MARGIN_M, 0.5 * length_m)
    return margin + fraction * (length_m - 2.0 * margin)


@lean_kernel
def random_walk(game: Game, boat: int, memory: Array, streams: np.ndarray, slot: int) -> tuple[float, float]:
    """Draw one of the 17 discrete actions, hold its absolute heading and speed for 1 to 5 s, draw again.

    A course that would leave the field is replaced by one to a random point inside it.
    """
    memory[TIME_LEFT] -= game.field[STEP]
    if memory[TIME_LEFT] <= 0.0:
        draw_course(game, boat, memory, streams, slot)
    return memory[HELD_SPEED], wrap_deg(memory[HELD_HEADING] - game.state[boat, L.HEADING])


@lean_kernel
def draw_course(game: Game, boat: int, memory: Array, streams: np.ndarray, slot: int) -> None:
    """Write a new held course into the memory row."""
    hold_s = HOLD_MIN_S + (HOLD_MAX_S - HOLD_MIN_S) * next_uniform(streams, slot)
    action = min(int(17.0 * next_uniform(streams, slot)), 16)
    speed = 0.0 if action == 16 else game.limits[boat, MAX_SPEED] * (1.0 if action < 8 else 0.5)
    heading = game.state[boat, L.HEADING] + (0.0 if action == 16 else 180.0 - 45.0 * (action % 8))
    ahead_m = WALL_MARGIN_M + game.limits[boat, MAX_SPEED] * hold_s
    x, y = game.state[boat, L.X], game.state[boat, L.Y]
    x_ahead = x + ahead_m * math.sin(math.radians(heading))
    y_ahead = y + ahead_m * math.cos(math.radians(heading))
    if not (0.0 < x_ahead < game.field[WIDTH] and 0.0 < y_ahead < game.field[HEIGHT]):
        x_inside, y_inside = random_point(game, boat, streams, slot)
        heading = math.degrees(math.atan2(x_inside - x, y_inside - y))
        speed = max(speed, 0.5 * game.limits[boat, MAX_SPEED])
    memory[TIME_LEFT], memory[HELD_SPEED], memory[HELD_HEADING] = hold_s, speed, heading


@lean_kernel
def ram(game: Game, boat: int) -> tuple[float, float]:
    """Steer for the predicted meeting point with the nearest boat; stop if there is none."""
    target = nearest_target(game, boat)
    if target < 0:
        return 0.0, 0.0
    speed = game.field[SPEED_FRACTION] * game.limits[boat, MAX_SPEED]
    heading = math.radians(game.state[target, L.HEADING])
    east_mps = game.state[target, L.SPEED] * math.sin(heading)
    north_mps = game.state[target, L.SPEED] * math.cos(heading)
    x, y = game.state[target, L.X], game.state[target, L.Y]
    lead_s = meeting_time_s(x - game.state[boat, L.X], y - game.state[boat, L.Y], east_mps, north_mps, speed)
    margin = game.limits[boat, RADIUS]
    # a boat that leaves the field is tagged and sent home: meet it inside, not beyond the edge
    x = min(max(x + lead_s * east_mps, margin), game.field[WIDTH] - margin)
    y = min(max(y + lead_s * north_mps, margin), game.field[HEIGHT] - margin)
    return speed, bearing_deg(*to_boat(game, boat, x, y))


@lean_kernel
def meeting_time_s(east_m: float, north_m: float, east_mps: float, north_mps: float, speed_mps: float) -> float:
    """Return the earliest time at which a boat at the origin can meet a target on a straight course.

    Solves |p + v t| = s t for the smallest t > 0. If there is no solution (or only after ``LEAD_LIMIT_S``), the lead is
    the time to cover the present distance, with the same limit: an estimate is better than none.

    Args:
        east_m: target's position east of the boat, m.
        north_m: target's position north of the boat, m.
        east_mps: target's velocity east, m/s.
        north_mps: target's velocity north, m/s.
        speed_mps: own speed, m/s.
    """
    distance = math.hypot(east_m, north_m)
    guess = min(distance / speed_mps, LEAD_LIMIT_S) if speed_mps > 0.0 else 0.0
    a = speed_mps**2 - east_mps**2 - north_mps**2
    b = east_m * east_mps + north_m * north_mps
    root = b * b + a * distance**2
    if root < 0.0:
        return guess
    root = math.sqrt(root)
    # root + b and root - b are both used so that neither case divides by a small a
    if a > 0.0:
        time = distance**2 / (root - b) if b < 0.0 else (b + root) / a
    elif b < 0.0:
        time = distance**2 / (root - b)
    else:
        return guess
    return time if time <= LEAD_LIMIT_S else guess


@lean_kernel
def nearest_target(game: Game, boat: int) -> int:
    """Return the nearest boat of the other team, or of both with HIT_TEAM_MATES; -1 if there is none."""
    best, best_m = -1, math.inf
    for other in range(game.team.size):
        if other == boat or (game.team[other] == game.team[boat] and game.field[HIT_TEAM_MATES] == 0.0):
            continue
        distance = math.hypot(
            game.state[other, L.X] - game.state[boat, L.X], game.state[other, L.Y] - game.state[boat, L.Y]
        )
        if distance < best_m:
            best, best_m = other, distance
    return best
