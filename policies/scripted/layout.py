"""Arrays that the scripted policies' compiled code reads and writes, and its plane geometry.

The own-end frame of a team has its flag on the left. For a team with the flag on the left (blue, as a rule) it is the
field. For the other team it is the field turned by 180 deg. A boat's frame is (right, forward).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from steerclear.env.randomness import GAMMA, MIX_1, mix
from steerclear.shield.jit import Array, BoolArray, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L


class Behaviour(IntEnum):
    """Behaviour of one boat; a team is a list of these, one per boat."""

    HOLD = 0
    RANDOM = 1
    RAMMER = 2
    WAYPOINTS = 3
    EASY_ATTACK = 4
    EASY_DEFEND = 5
    MEDIUM_ATTACK = 6
    MEDIUM_DEFEND = 7
    HARD_ATTACK = 8
    HARD_DEFEND = 9
    HARD = 10


GOAL, GOAL_X, GOAL_Y, TIME_LEFT, HELD_SPEED, HELD_HEADING, REACHED, N_MEMORY = 0, 1, 2, 3, 4, 5, 6, 7
"""Columns of a boat's memory.

They are: number of the path point or given waypoint it steers for; waypoint east and north, m; time until the next
draw, s (0 before the first draw); speed, m/s, and absolute heading, deg, held by the random walk; waypoints reached so
far.
"""
WIDTH, HEIGHT, KEEPOUT, STEP, SPEED_FRACTION, HIT_TEAM_MATES, MEDIUM_REACH, CORNER_INSET = 0, 1, 2, 3, 4, 5, 6, 7
N_FIELD = 8
"""Columns of the field row.

They are: field along x and y, m; keep-out radius round the own flag, without the boat's radius, m; time between two
decisions, s; share of top speed of a rammer or waypoint boat; 1 if a rammer also targets teammates; distance within
which opponents repel a medium attacker, m; inset of the capture points from the own side's corners, along both edges, m
(0: captures are not at corners).
"""
MAX_SPEED, RADIUS, N_LIMIT = 0, 1, 2
"""Columns of a boat's limits: top speed, m/s, and agent radius, m."""


class Game(NamedTuple):
    """One game as the kernels read it: ``n`` boats, two teams (0 blue, 1 red)."""

    state: Array
    """``(n, N_STATE)`` state rows, see ``steerclear.shield.platforms.layout``."""
    limits: Array
    """``(n, N_LIMIT)``."""
    team: IntArray
    """``(n,)``."""
    is_tagged: BoolArray
    has_flag: BoolArray
    on_side: BoolArray
    flag_home: Array
    """``(2, 2)`` m."""
    flag_position: Array
    """``(2, 2)`` m; a taken flag is where its carrier is."""
    field: Array
    """``(N_FIELD,)``."""


@lean_kernel
def to_boat(game: Game, boat: int, x_m: float, y_m: float) -> tuple[float, float]:
    """Return a point of the field in the boat's frame: (right, forward), m."""
    heading = math.radians(game.state[boat, L.HEADING])
    east, north = x_m - game.state[boat, L.X], y_m - game.state[boat, L.Y]
    sine, cosine = math.sin(heading), math.cos(heading)
    return east * cosine - north * sine, east * sine + north * cosine


@lean_kernel
def boat_to_boat(game: Game, boat: int, other: int) -> tuple[float, float]:
    """Return another boat's place in the boat's frame: (right, forward), m."""
    return to_boat(game, boat, game.state[other, L.X], game.state[other, L.Y])


@lean_kernel
def unit(right: float, forward: float) -> tuple[float, float]:
    """Scale a vector to length 1; a zero vector stays zero."""
    length = math.hypot(right, forward)
    if length == 0.0:
        return 0.0, 0.0
    return right / length, forward / length


@lean_kernel
def bearing_deg(right: float, forward: float) -> float:
    """Return the relative bearing of a vector in the boat's frame, deg clockwise, in (-180, 180]."""
    return math.degrees(math.atan2(right, forward))


@lean_kernel
def is_turned(game: Game, team: int) -> bool:
    """Return whether the team's flag is on the right, so that its own-end frame is the field turned by 180 deg."""
    return game.flag_home[team, 0] > 0.5 * game.field[WIDTH]


@lean_kernel
def own_end_point(game: Game, team: int, along: float, across: float) -> tuple[float, float]:
    """Return a point in the field's frame, m, from fractions of the field in the team's own-end frame."""
    if is_turned(game, team):
        along, across = 1.0 - along, 1.0 - across
    return along * game.field[WIDTH], across * game.field[HEIGHT]


@lean_kernel
def place_of_capture(game: Game, boat: int) -> tuple[float, float]:
    """Return where a boat brings the flag, m: its own flag's home, or the nearer of its side's corner marks."""
    team, inset_m = game.team[boat], game.field[CORNER_INSET]
    if inset_m == 0.0:
        return game.flag_home[team, 0], game.flag_home[team, 1]
    x = game.field[WIDTH] - inset_m if is_turned(game, team) else inset_m
    lower = game.state[boat, L.Y] < 0.5 * game.field[HEIGHT]
    return x, inset_m if lower else game.field[HEIGHT] - inset_m


@lean_kernel
def wrap_deg(angle: float) -> float:
    """Wrap an angle into [-180, 180)."""
    return (angle + 180.0) % 360.0 - 180.0


@lean_kernel
def seed_streams(seeds: np.ndarray, boats: np.ndarray, chosen: np.ndarray, streams: np.ndarray) -> None:
    """Start one independent stream per boat in the chosen games, in place."""
    for g in range(seeds.size):
        for slot in range(boats.size):
            if chosen[g]:
                streams[g, slot] = mix(mix(seeds[g] + GAMMA) ^ (np.uint64(boats[slot] + 1) * MIX_1))
