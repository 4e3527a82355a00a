"""Which boats the game itself drives, and where to: what every boat will obey, decided before anything moves.

A tagged boat drives straight to its own flag's home, or to the nearer corner of its side, past obstacles as `detour`
has it; a boat out of bounds drives straight off the nearest edge; a disabled one coasts.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to, wrap_bearing
from .arrays import Games, Rules
from .detour import heading_past_obstacles
from .obstacles import touches_obstacle


@lean_kernel
def heading_into_field(size: Array, x: float, y: float) -> float:
    """Heading perpendicular to the edge nearest to (x, y), pointing inwards, deg."""
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
    """Which of two marks (2, 2), m, is nearer to (x, y): 0 or 1, and 0 where both are as near."""
    first = math.sqrt((marks[0, 0] - x) ** 2 + (marks[0, 1] - y) ** 2)
    second = math.sqrt((marks[1, 0] - x) ** 2 + (marks[1, 1] - y) ** 2)
    return 1 if second < first else 0


@lean_kernel
def _drive(rules: Rules, games: Games, b: int, i: int, command: Array) -> None:
    """Command of a boat that is tagged or out of bounds: speed m/s, relative heading deg."""
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
def decide_commands(rules: Rules, games: Games, actions: Array, commands: Array) -> int:
    """What every boat will obey; fills ``commands`` and ``games.driven``.

    Args:
        rules: the rules.
        games: the games; only ``driven`` is written.
        actions: (B, n, 2) what the policies want: speed m/s, relative heading deg.
        commands: (B, n, 2) output, same units.

    Returns:
        -1, or the flat number ``b * n + i`` of the first boat whose own command is not finite and would be obeyed.
    """
    return decide_games(rules, games, actions, commands, 0, games.state.shape[0])


@lean_kernel
def decide_boat(rules: Rules, games: Games, actions: Array, commands: Array, b: int, i: int) -> None:
    """What one boat will obey; fills its row of ``commands``, and ``games.driven``."""
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
        # the reference hands policies' commands to the autopilot in single precision
        commands[b, i, 0] = np.float32(actions[b, i, 0])
        commands[b, i, 1] = np.float32(actions[b, i, 1])


@lean_kernel
def decide_games(rules: Rules, games: Games, actions: Array, commands: Array, first: int, last: int) -> int:
    """`decide_commands` of the games first..last-1."""
    for b in range(first, last):
        for i in range(rules.n_boats):
            decide_boat(rules, games, actions, commands, b, i)
            if not (math.isfinite(actions[b, i, 0]) and math.isfinite(actions[b, i, 1])):
                return b * rules.n_boats + i
    return -1
