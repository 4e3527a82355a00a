"""One step of all games: the compiled outer loop."""

from __future__ import annotations

import math

from steerclear.shield.jit import Array, kernel

from . import rules as R
from .arrays import Games, Rules
from .collisions import check_collisions
from .motion import move_boat


@kernel
def first_unusable(commands: Array) -> int:
    """Flat number ``b * n + i`` of the first command (B, n, 2) that is not finite, or -1."""
    for b in range(commands.shape[0]):
        for i in range(commands.shape[1]):
            if not (math.isfinite(commands[b, i, 0]) and math.isfinite(commands[b, i, 1])):
                return b * commands.shape[1] + i
    return -1


@kernel
def advance_game(rules: Rules, games: Games, b: int, commands: Array) -> None:
    """Move the boats of game ``b`` under ``commands`` (n, 2) and apply the rules."""
    games.events[b] = 0
    R.recharge(rules, games, b)
    for i in range(rules.n_boats):
        move_boat(rules, games, b, i, commands[i])
    games.time_s[b] += rules.dt_s
    R.check_bounds(rules, games, b)
    R.check_grabs(rules, games, b)
    R.check_tags(rules, games, b)
    R.check_captures(rules, games, b)
    R.check_untags(rules, games, b)
    R.check_end(rules, games, b)
    check_collisions(rules, games, b)


@kernel
def advance_games(rules: Rules, games: Games, commands: Array) -> None:
    """`advance_game` for every game; ``commands`` is (B, n, 2): speed m/s, relative heading deg."""
    for b in range(games.state.shape[0]):
        advance_game(rules, games, b, commands[b])
