"""Plane geometry of the kernels: boat frame (right, forward), own-end frame of a team, and random numbers.

A team's own-end frame is the field as a team sees it whose flag is on the left (blue, as a rule); for a team whose
flag is on the right it is the field turned by 180 deg.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.env.randomness import GAMMA, MIX_1, mix
from steerclear.shield.jit import lean_kernel
from steerclear.shield.platforms import layout as L

from .layout import CORNER_INSET, HEIGHT, WIDTH, Game


@lean_kernel
def to_boat(game: Game, boat: int, x_m: float, y_m: float) -> tuple[float, float]:
    """Point of the field in the boat's frame: (right, forward), m."""
    heading = math.radians(game.state[boat, L.HEADING])
    east, north = x_m - game.state[boat, L.X], y_m - game.state[boat, L.Y]
    sine, cosine = math.sin(heading), math.cos(heading)
    return east * cosine - north * sine, east * sine + north * cosine


@lean_kernel
def boat_to_boat(game: Game, boat: int, other: int) -> tuple[float, float]:
    """Another boat in the boat's frame: (right, forward), m."""
    return to_boat(game, boat, game.state[other, L.X], game.state[other, L.Y])


@lean_kernel
def unit(right: float, forward: float) -> tuple[float, float]:
    """The vector scaled to length 1; a zero vector stays zero."""
    length = math.hypot(right, forward)
    if length == 0.0:
        return 0.0, 0.0
    return right / length, forward / length


@lean_kernel
def bearing_deg(right: float, forward: float) -> float:
    """Relative bearing of a vector in the boat's frame, deg clockwise, in (-180, 180]."""
    return math.degrees(math.atan2(right, forward))


@lean_kernel
def is_turned(game: Game, team: int) -> bool:
    """Whether the team's flag is on the right, so that its own-end frame is the field turned by 180 deg."""
    return game.flag_home[team, 0] > 0.5 * game.field[WIDTH]


@lean_kernel
def own_end_point(game: Game, team: int, along: float, across: float) -> tuple[float, float]:
    """Point given as fractions of the field in the team's own-end frame, m in the field's frame."""
    if is_turned(game, team):
        along, across = 1.0 - along, 1.0 - across
    return along * game.field[WIDTH], across * game.field[HEIGHT]


@lean_kernel
def place_of_capture(game: Game, boat: int) -> tuple[float, float]:
    """Where a boat brings the flag to, m: its own flag's home, or the nearer of its side's corner marks."""
    team, inset_m = game.team[boat], game.field[CORNER_INSET]
    if inset_m == 0.0:
        return game.flag_home[team, 0], game.flag_home[team, 1]
    x = game.field[WIDTH] - inset_m if is_turned(game, team) else inset_m
    lower = game.state[boat, L.Y] < 0.5 * game.field[HEIGHT]
    return x, inset_m if lower else game.field[HEIGHT] - inset_m


@lean_kernel
def wrap_deg(angle: float) -> float:
    """The same angle in [-180, 180)."""
    return (angle + 180.0) % 360.0 - 180.0


@lean_kernel
def seed_streams(seeds: np.ndarray, boats: np.ndarray, chosen: np.ndarray, streams: np.ndarray) -> None:
    """Start one independent stream per boat in the chosen games, in place.

    Args:
        seeds: (B,) uint64, one per game.
        boats: (n_team,) numbers of the boats.
        chosen: (B,) bool, which games.
        streams: (B, n_team) uint64, written.
    """
    for g in range(seeds.size):
        for slot in range(boats.size):
            if chosen[g]:
                streams[g, slot] = mix(mix(seeds[g] + GAMMA) ^ (np.uint64(boats[slot] + 1) * MIX_1))
