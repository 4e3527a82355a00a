"""Motion of the boats of one game, in boat order: own side, obstacle hits, dynamics, keep-out, carried flags."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat
from steerclear.shield.platforms.usv import wrap_degrees

from .angles import heading_to
from .arrays import Games, Rules
from .obstacles import touches_obstacle


@lean_kernel
def is_on_side(line: Array, side_sign: float, x: float, y: float) -> bool:
    """Return whether (x, y) lies on a team's side of the dividing line (2, 2), or on the line itself."""
    along_x, along_y = line[1, 0] - line[0, 0], line[1, 1] - line[0, 1]
    cross = along_x * (y - line[0, 1]) - along_y * (x - line[0, 0])
    return cross * side_sign >= 0.0


@lean_kernel
def is_within(state: Array, place: Array, radius_m: float) -> bool:
    """Return whether a boat (its state row) is closer to a place (x, y) than ``radius_m``."""
    dx, dy = state[L.X] - place[0], state[L.Y] - place[1]
    return math.sqrt(dx * dx + dy * dy) < radius_m


@lean_kernel
def send_flag_home(rules: Rules, games: Games, b: int, flag: int) -> None:
    """Put a team's flag back to its home."""
    games.flag_taken[b, flag] = False
    games.flag_position[b, flag, 0] = rules.flag_home[flag, 0]
    games.flag_position[b, flag, 1] = rules.flag_home[flag, 1]


@lean_kernel
def drop_flag(rules: Rules, games: Games, b: int, i: int) -> None:
    """Drop the flag that boat ``i`` may carry; it goes home."""
    if games.has_flag[b, i]:
        games.has_flag[b, i] = False
        send_flag_home(rules, games, b, 1 - rules.team[i])


@lean_kernel
def penalise_hit(rules: Rules, games: Games, b: int, i: int) -> None:
    """Apply the cost of hitting an obstacle to boat ``i``: it loses the flag, and may be tagged by the rules."""
    if rules.tag_on_collision:
        games.is_tagged[b, i] = True
    drop_flag(rules, games, b, i)


@lean_kernel
def bounce_off(rules: Rules, games: Games, b: int, i: int) -> None:
    """Put a boat that hit an obstacle back, turned round, stopped and without flag. Its autopilot's memory stays."""
    state = games.state[b, i]
    penalise_hit(rules, games, b, i)
    before = games.previous_position[b, i]
    x, y = state[L.X], state[L.Y]
    state[L.X], state[L.Y] = before[0], before[1]
    before[0], before[1] = x, y
    state[L.HEADING] = wrap_degrees(state[L.HEADING] + 180.0)
    state[L.SPEED] = 0.0
    state[L.THRUST] = 0.0
    state[L.RUDDER] = 0.0
    state[L.TURN_RATE] = 0.0


@lean_kernel
def obey(params: Array, state: Array, is_float32: bool, was_float32: bool, command: Array, dt_s: float) -> bool:
    """Advance a boat by one step; return whether the heading controller's last error is in single precision.

    The reference subtracts the controller's last two errors in single precision if both are in single precision. The
    memory is shifted so that the double-precision derivative is the same.
    """
    error = command[1]
    memory = state[L.HEADING_ERROR]
    if is_float32 and was_float32 and not math.isnan(memory):
        state[L.HEADING_ERROR] = error - np.float64(np.float32(error) - np.float32(memory))
    step_boat(params, state, command[0], error, dt_s)
    if state[L.THRUST] > 0.0:
        return is_float32
    state[L.HEADING_ERROR] = memory
    return was_float32


@lean_kernel
def move_boat(rules: Rules, games: Games, commands: Array, b: int, i: int) -> None:
    """Move one boat by one step under its row of ``commands`` (B, n, 2): speed m/s, relative heading deg."""
    state = games.state[b, i]
    team = rules.team[i]
    x, y = state[L.X], state[L.Y]
    games.on_side[b, i] = is_on_side(rules.scrimmage, rules.side_sign[team], x, y)
    if rules.obstacles.bounds.shape[0] > 0 and touches_obstacle(rules.obstacles, x, y, rules.agent_radius[i]):
        bounce_off(rules, games, b, i)
        return
    before = games.previous_position[b, i]
    before[0], before[1] = x, y
    # a policy's command is in single precision; one that the game or a filter has computed is not
    error = commands[b, i, 1]
    is_float32 = not games.driven[b, i] and np.float64(np.float32(error)) == error
    games.error_is_float32[b, i] = obey(
        rules.params[i], state, is_float32, games.error_is_float32[b, i], commands[b, i], rules.dt_s
    )
    if rules.flag_keepout > 0.0 and not games.flag_taken[b, team]:
        radius = rules.flag_keepout + rules.agent_radius[i]
        if is_within(state, rules.flag_home[team], radius):
            keep_out(state, before, rules.flag_home[team], radius)
    if games.has_flag[b, i]:
        games.flag_position[b, 1 - team, 0] = state[L.X]
        games.flag_position[b, 1 - team, 1] = state[L.Y]


@lean_kernel
def move_boats(rules: Rules, games: Games, commands: Array, first: int, last: int) -> None:
    """Move every boat by one step, in boat order, in the games first..last-1, under ``commands`` (B, n, 2)."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            move_boat(rules, games, commands, b, i)


@lean_kernel
def see_boat(state: Array, seen: Array) -> None:
    """Write ``seen`` (4,), x m, y m, heading deg, speed m/s, into a boat's state row."""
    state[L.X], state[L.Y] = seen[0], seen[1]
    state[L.HEADING] = wrap_degrees(seen[2])
    state[L.SPEED] = seen[3]


@lean_kernel
def place_boats(rules: Rules, games: Games, seen: Array, first: int, last: int) -> None:
    """Do what `move_boats` does for boats that something else moves.

    ``seen`` (B, n, 4) is x m, y m, heading deg, speed m/s. A boat whose position is NaN is on no side and out of
    bounds.
    """
    has_obstacles = rules.obstacles.bounds.shape[0] > 0
    for b in range(first, last):
        for i in range(rules.n_boats):
            state = games.state[b, i]
            x, y = state[L.X], state[L.Y]
            games.on_side[b, i] = is_on_side(rules.scrimmage, rules.side_sign[rules.team[i]], x, y)
            if has_obstacles and touches_obstacle(rules.obstacles, x, y, rules.agent_radius[i]):
                penalise_hit(rules, games, b, i)
            games.previous_position[b, i, 0], games.previous_position[b, i, 1] = x, y
            see_boat(state, seen[b, i])
            if games.has_flag[b, i]:
                games.flag_position[b, 1 - rules.team[i], 0] = state[L.X]
                games.flag_position[b, 1 - rules.team[i], 1] = state[L.Y]


BUFFER_M = 0.1
"""A boat that entered the circle is put this far outside of it."""


@lean_kernel
def _solve_along_x(
    x: float, y: float, slope: float, centre: Array, radius: float, forward: bool
) -> tuple[float, float]:
    """Return where a circle meets the line of that slope through (x, y): the point of larger x if ``forward``.

    Slope and intercept lose digits on steep lines. They are used in this order of operations all the same, because the
    reference does: the lost digits are part of its boats' positions.
    """
    h, k = centre[0], centre[1]
    intercept = y - slope * x
    a = 1.0 + slope * slope
    b = 2.0 * (-h + slope * intercept - slope * k)
    c = -2.0 * intercept * k + h * h + intercept * intercept + k * k - radius * radius
    root = math.sqrt(max(0.0, b * b - 4.0 * a * c))
    x = (-b + root) / (2.0 * a) if forward else (-b - root) / (2.0 * a)
    return x, slope * x + intercept


@lean_kernel
def entry_point(inside: Array, before: Array, centre: Array, radius: float) -> tuple[float, float]:
    """Return where the ray from (x, y) ``inside`` through ``before`` leaves a circle, m.

    A boat at rest leaves it outwards, from the centre.
    """
    x, y = inside[0], inside[1]
    to_x, to_y = before[0], before[1]
    if x == to_x and y == to_y:
        x, y = centre[0], centre[1]
    if x == to_x and y == to_y:
        return centre[0] + radius, centre[1]
    if x == to_x:
        reach = math.sqrt(max(0.0, radius * radius - (x - centre[0]) ** 2))
        return x, centre[1] + (reach if to_y > y else -reach)
    if y == to_y:
        reach = math.sqrt(max(0.0, radius * radius - (y - centre[1]) ** 2))
        return centre[0] + (reach if to_x > x else -reach), y
    return _solve_along_x(x, y, (to_y - y) / (to_x - x), centre, radius, to_x > x)


@lean_kernel
def keep_out(state: Array, before: Array, centre: Array, radius: float) -> None:
    """Put a boat that entered the circle, from (x, y) ``before``, back onto it, with its tangential velocity."""
    x, y = entry_point(state[: L.Y + 1], before, centre, radius + BUFFER_M)
    heading = math.radians(state[L.HEADING])
    # single precision, as in the reference
    velocity_x = np.float64(np.float32(state[L.SPEED] * math.sin(heading)))
    velocity_y = np.float64(np.float32(state[L.SPEED] * math.cos(heading)))
    out_x, out_y = x - centre[0], y - centre[1]
    length = math.hypot(out_x, out_y)
    tangent_x, tangent_y = out_y / length, -out_x / length
    along = velocity_x * tangent_x + velocity_y * tangent_y
    state[L.X], state[L.Y] = x, y
    state[L.SPEED] = abs(along)
    state[L.HEADING] = heading_to(along * tangent_x, along * tangent_y)
