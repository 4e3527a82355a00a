"""One step of all games, compiled."""

from __future__ import annotations

import math

from steerclear.shield.jit import Array, lean_kernel

from . import rules as R
from .arrays import Games, Rules
from .collisions import check_collisions
from .motion import move_boats, place_boats

CHUNK = 64
"""Games handled together, rule by rule."""


@lean_kernel
def first_unusable(commands: Array) -> int:
    """Flat number ``b * n + i`` of the first command (B, n, 2) that is not finite, or -1."""
    for b in range(commands.shape[0]):
        for i in range(commands.shape[1]):
            if not (math.isfinite(commands[b, i, 0]) and math.isfinite(commands[b, i, 1])):
                return b * commands.shape[1] + i
    return -1


@lean_kernel
def _after_the_move(rules: Rules, games: Games, first: int, last: int) -> None:
    for b in range(first, last):
        games.time_s[b] += rules.dt_s
    R.check_bounds(rules, games, first, last)
    R.check_grabs(rules, games, first, last)
    R.check_tags(rules, games, first, last)
    R.check_captures(rules, games, first, last)
    R.check_untags(rules, games, first, last)
    R.check_end(rules, games, first, last)
    check_collisions(rules, games, first, last)


@lean_kernel
def advance_games(rules: Rules, games: Games, commands: Array) -> None:
    """Move all boats under ``commands`` (B, n, 2), speed m/s and relative heading deg, and apply the rules.

    Games do not touch each other, so each rule runs over a chunk of games that fits into the cache.
    """
    n_games = games.state.shape[0]
    games.events[:] = 0
    for first in range(0, n_games, CHUNK):
        last = min(first + CHUNK, n_games)
        R.recharge(rules, games, first, last)
        move_boats(rules, games, commands, first, last)
        _after_the_move(rules, games, first, last)


@lean_kernel
def follow_games(rules: Rules, games: Games, seen: Array) -> None:
    """Apply the rules to boats that moved by themselves to ``seen`` (B, n, 4), see `motion.place_boats`."""
    n_games = games.state.shape[0]
    games.events[:] = 0
    for first in range(0, n_games, CHUNK):
        last = min(first + CHUNK, n_games)
        R.recharge(rules, games, first, last)
        place_boats(rules, games, seen, first, last)
        _after_the_move(rules, games, first, last)
