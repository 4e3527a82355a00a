"""Defenders: drawn to opponents in their half (medium), between them and the flag (hard)."""

from __future__ import annotations

import math

from steerclear.shield.jit import lean_kernel
from steerclear.shield.platforms import layout as L

from .attack import HARD_REACH_M, field_attack, push_of_walls, team_has_flag
from .geometry import bearing_deg, boat_to_boat, own_end_point, to_boat, unit
from .layout import KEEPOUT, MAX_SPEED, Game

GUARD_POINT = (0.25, 0.5)  # own-end fractions: halfway between the own flag and the scrimmage line's middle
GUARD_REACHED_M = 2.5
PERIMETER_KEEPOUTS = 5.0
LEAST_KEEPOUT_M = 3.0  # where there is no keep-out circle, the perimeter is that of the competitions that have one
WALL_AHEAD_M = 7.0
WALL_REACH_M = 10.0
THREAT_M = 30.0


@lean_kernel
def medium_defend(game: Game, boat: int) -> tuple[float, float]:
    """Chase a taken flag, else the nearest untagged opponent in the own half, else wait in front of the base."""
    team = game.team[boat]
    max_speed = game.limits[boat, MAX_SPEED]
    if team_has_flag(game, 1 - team):
        x, y = game.flag_position[team]
        return max_speed, bearing_deg(*to_boat(game, boat, x, y))
    intruder = nearest_opponent(game, boat, True)
    if intruder >= 0:
        return max_speed, bearing_deg(*boat_to_boat(game, boat, intruder))
    x, y = own_end_point(game, team, *GUARD_POINT)
    right, forward = to_boat(game, boat, x, y)
    if math.hypot(right, forward) <= GUARD_REACHED_M:
        return 0.0, 0.0
    return max_speed, bearing_deg(right, forward)


@lean_kernel
def hard_defend(game: Game, boat: int) -> tuple[float, float]:
    """Stay between the own flag and the nearest opponent, go for it inside the perimeter, chase a taken flag."""
    team = game.team[boat]
    x, y = game.flag_position[team]
    right, forward = to_boat(game, boat, x, y)
    if team_has_flag(game, 1 - team):
        right, forward = unit(right, forward)
    else:
        right, forward = guard_point(game, boat, right, forward)
    wall_right, wall_forward = unit(*push_of_walls(game, boat, WALL_AHEAD_M, WALL_REACH_M))
    return game.limits[boat, MAX_SPEED], bearing_deg(right - wall_right, forward - wall_forward)


@lean_kernel
def hard(game: Game, boat: int) -> tuple[float, float]:
    """Both roles: attack, but defend while the own flag is taken or the opponents' centre comes near it."""
    team = game.team[boat]
    defends = team_has_flag(game, 1 - team) or is_threatened(game, team)
    if defends and not game.has_flag[boat]:
        return hard_defend(game, boat)
    return field_attack(game, boat, HARD_REACH_M, True)


@lean_kernel
def is_threatened(game: Game, team: int) -> bool:
    """Whether the mean position of the opponents is within ``THREAT_M`` of the team's flag and one is untagged."""
    x = y = count = 0.0
    untagged = False
    for other in range(game.team.size):
        if game.team[other] != team:
            x, y, count = x + game.state[other, L.X], y + game.state[other, L.Y], count + 1.0
            untagged = untagged or not game.is_tagged[other]
    flag_x, flag_y = game.flag_position[team]
    return untagged and math.hypot(x / count - flag_x, y / count - flag_y) < THREAT_M


@lean_kernel
def guard_point(game: Game, boat: int, flag_right: float, flag_forward: float) -> tuple[float, float]:
    """Where a hard defender wants to be, boat frame, m."""
    target = nearest_opponent(game, boat, False)
    if target < 0:
        return flag_right, flag_forward
    right, forward = boat_to_boat(game, boat, target)
    gap_m = math.hypot(right - flag_right, forward - flag_forward)
    perimeter_m = PERIMETER_KEEPOUTS * (game.field[KEEPOUT] if game.field[KEEPOUT] > 0.0 else LEAST_KEEPOUT_M)
    if gap_m <= perimeter_m and not game.is_tagged[target]:
        return right, forward
    toward_right, toward_forward = unit(right - flag_right, forward - flag_forward)
    out_m = perimeter_m if game.is_tagged[target] else min(0.5 * gap_m, perimeter_m)
    return flag_right + out_m * toward_right, flag_forward + out_m * toward_forward


@lean_kernel
def nearest_opponent(game: Game, boat: int, intruders_only: bool) -> int:
    """Nearest untagged opponent (or, if none and all count, the nearest of all); -1 when there is none."""
    best, best_m = -1, math.inf
    fallback, fallback_m = -1, math.inf
    for other in range(game.team.size):
        if game.team[other] == game.team[boat] or (intruders_only and game.on_side[other]):
            continue
        distance = math.hypot(*boat_to_boat(game, boat, other))
        if not game.is_tagged[other] and distance < best_m:
            best, best_m = other, distance
        if distance < fallback_m:
            fallback, fallback_m = other, distance
    return best if best >= 0 or intruders_only else fallback
