"""Attackers and defenders of the organisers' teams: a fixed loop (easy), potential fields (medium, hard).

The flag attracts attackers, and opponents repel them. Medium defenders chase opponents in their half. Hard defenders
stay between opponents and the flag.
"""

from __future__ import annotations

import math

from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L

from .boats import follow
from .layout import (
    CORNER_INSET,
    GOAL,
    HEIGHT,
    KEEPOUT,
    MAX_SPEED,
    WIDTH,
    Game,
    bearing_deg,
    boat_to_boat,
    is_turned,
    own_end_point,
    place_of_capture,
    to_boat,
    unit,
)

HARD_REACH_M = 30.0
WALL_REACH_M = 10.0
GOAL_WEIGHT = 1.25
STALEMATE = 0.1
WALL_BIAS = 1.25
# own-end fractions (along, across): scrimmage line starboard, their flag, scrimmage line port, own flag
EASY_LOOP = ((0.5, 0.25), (0.875, 0.5), (0.5, 0.75), (0.125, 0.5))
POINT_REACHED_M = 2.5
HOME_REACHED_M = 6.0  # the own flag's keep-out circle is larger than POINT_REACHED_M
GUARD_POINT = (0.25, 0.5)  # own-end fractions: halfway between the own flag and the scrimmage line's middle
GUARD_REACHED_M = 2.5
PERIMETER_KEEPOUTS = 5.0
LEAST_KEEPOUT_M = 3.0  # without a keep-out circle, the perimeter is that of the competitions that have one
WALL_AHEAD_M = 7.0
THREAT_M = 30.0


@lean_kernel
def easy_attack(game: Game, boat: int, memory: Array) -> tuple[float, float]:
    """Loop own base (or corner) -> opponent's flag -> back at full speed; a tag restarts the loop.

    Returns:
        Speed m/s and relative heading deg.
    """
    if game.is_tagged[boat]:
        memory[GOAL] = 0.0
    goal = int(memory[GOAL])
    reach_m = HOME_REACHED_M if goal == 3 else POINT_REACHED_M
    x, y = _point_of_loop(game, boat, goal)
    if math.hypot(x - game.state[boat, L.X], y - game.state[boat, L.Y]) <= reach_m:
        memory[GOAL] = (goal + 1) % 4
        x, y = _point_of_loop(game, boat, (goal + 1) % 4)
    return follow(game, boat, x, y)


@lean_kernel
def _point_of_loop(game: Game, boat: int, goal: int) -> tuple[float, float]:
    """Return a point of the easy attacker's loop, m; its last point is where captures are made."""
    if goal == 3 and game.field[CORNER_INSET] > 0.0:
        return place_of_capture(game, boat)
    along, across = EASY_LOOP[goal]
    return own_end_point(game, game.team[boat], along, across)


@lean_kernel
def field_attack(game: Game, boat: int, reach_m: float, shares_flag: bool) -> tuple[float, float]:
    """Steer at full speed for the flag, repelled by opponents and near walls.

    With the flag, steer for the place of capture. With ``shares_flag`` the boat also goes home when a teammate carries
    the flag.
    """
    team = game.team[boat]
    push_right, push_forward = push(game, boat, reach_m)
    homeward = game.has_flag[boat] or (shares_flag and team_has_flag(game, team))
    x, y = game.flag_position[1 - team, 0], game.flag_position[1 - team, 1]
    if homeward:
        x, y = place_of_capture(game, boat)
    right, forward = unit(*to_boat(game, boat, x, y))
    if not homeward and is_stalemate(right, forward, push_right, push_forward):
        right, forward = to_far_wall(game, boat)
    else:
        right, forward = GOAL_WEIGHT * right + push_right, GOAL_WEIGHT * forward + push_forward
    return game.limits[boat, MAX_SPEED], bearing_deg(right, forward)


@lean_kernel
def is_stalemate(right: float, forward: float, push_right: float, push_forward: float) -> bool:
    """Return whether attraction and repulsion nearly cancel.

    As in the reference opponents, they are compared in size per boat axis.
    """
    return abs(abs(right) - abs(push_right)) <= STALEMATE and abs(abs(forward) - abs(push_forward)) <= STALEMATE


@lean_kernel
def to_far_wall(game: Game, boat: int) -> tuple[float, float]:
    """Return the way out of a stalemate: to the farther long wall, biased so that the choice does not alternate."""
    y, height = game.state[boat, L.Y], game.field[HEIGHT]
    turned = is_turned(game, game.team[boat])
    starboard, port = (height - y, y) if turned else (y, height - y)
    to_starboard = abs(starboard) > WALL_BIAS * abs(port)
    y_wall = height if to_starboard == turned else 0.0
    return to_boat(game, boat, game.state[boat, L.X], y_wall)


@lean_kernel
def push(game: Game, boat: int, reach_m: float) -> tuple[float, float]:
    """Return the unit vector away from all opponents, tagged or not, and walls ahead, weighted by 1/distance."""
    right, forward = push_of_walls(game, boat, WALL_REACH_M, reach_m)
    for other in range(game.team.size):
        if game.team[other] != game.team[boat]:
            r, f = weighted(*boat_to_boat(game, boat, other), reach_m)
            right, forward = right + r, forward + f
    right, forward = unit(right, forward)
    return -right, -forward


@lean_kernel
def weighted(right: float, forward: float, reach_m: float) -> tuple[float, float]:
    """Return the direction to an object, times reach / distance; zero beyond the reach."""
    distance = math.hypot(right, forward)
    if distance >= reach_m or distance == 0.0:
        return 0.0, 0.0
    return right * reach_m / distance**2, forward * reach_m / distance**2


@lean_kernel
def push_of_walls(game: Game, boat: int, wall_reach_m: float, reach_m: float) -> tuple[float, float]:
    """Return the weighted sum of the nearest points of walls ahead and within ``wall_reach_m`` (one per axis)."""
    x, y = game.state[boat, L.X], game.state[boat, L.Y]
    width, height = game.field[WIDTH], game.field[HEIGHT]
    near_y, far_y, near_x, far_x = 0.0, height, 0.0, width
    if is_turned(game, game.team[boat]):
        near_y, far_y, near_x, far_x = height, 0.0, width, 0.0
    right, forward = weighted_wall(game, boat, x, near_y, wall_reach_m, reach_m)
    if right == 0.0 and forward == 0.0:
        right, forward = weighted_wall(game, boat, x, far_y, wall_reach_m, reach_m)
    r, f = weighted_wall(game, boat, near_x, y, wall_reach_m, reach_m)
    if r == 0.0 and f == 0.0:
        r, f = weighted_wall(game, boat, far_x, y, wall_reach_m, reach_m)
    return right + r, forward + f


@lean_kernel
def weighted_wall(
    game: Game, boat: int, x: float, y: float, wall_reach_m: float, reach_m: float
) -> tuple[float, float]:
    """Return a wall's nearest point, weighted; zero if it is not ahead or beyond ``wall_reach_m``."""
    right, forward = to_boat(game, boat, x, y)
    if forward <= 0.0 or math.hypot(right, forward) >= wall_reach_m:
        return 0.0, 0.0
    return weighted(right, forward, reach_m)


@lean_kernel
def team_has_flag(game: Game, team: int) -> bool:
    """Return whether any boat of the team carries the flag."""
    for boat in range(game.team.size):  # noqa: SIM110 (numba compiles no generators in any())
        if game.team[boat] == team and game.has_flag[boat]:
            return True
    return False


@lean_kernel
def medium_defend(game: Game, boat: int) -> tuple[float, float]:
    """Chase a taken flag, otherwise the nearest untagged opponent in the own half, otherwise wait before the base."""
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
    """Stay between own flag and nearest opponent; attack it inside the perimeter; chase a taken flag."""
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
    """Play both roles: attack, but defend while the own flag is taken or the opponents' centre is near it."""
    team = game.team[boat]
    defends = team_has_flag(game, 1 - team) or is_threatened(game, team)
    if defends and not game.has_flag[boat]:
        return hard_defend(game, boat)
    return field_attack(game, boat, HARD_REACH_M, True)


@lean_kernel
def is_threatened(game: Game, team: int) -> bool:
    """Return whether the opponents' mean position is within ``THREAT_M`` of the team's flag and one is untagged."""
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
    """Return the point that a hard defender steers for, boat frame, m."""
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
    """Return the nearest untagged opponent; -1 if there is none.

    If all are tagged, return the nearest of them, unless ``intruders_only``.
    """
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
