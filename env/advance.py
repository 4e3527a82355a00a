"""One decision of all games, compiled: the boats move, once or several times, then the rules are applied."""

from __future__ import annotations

from steerclear.shield.jit import Array, lean_kernel

from . import rules as R
from .arrays import Games, Rules
from .drive_home import decide_games
from .motion import move_boats, place_boats
from .rules import check_collisions, look_for_contacts

CHUNK = 64
"""Games processed together, rule by rule."""


@lean_kernel
def begin_decision(rules: Rules, games: Games) -> None:
    """Do what precedes the boats' motion, once their commands are known: clear events, recharge boats."""
    games.events[:] = 0
    R.recharge(rules, games, 0, games.state.shape[0])


@lean_kernel
def move_games(rules: Rules, games: Games, commands: Array) -> None:
    """Move all boats by one step under ``commands`` (B, n, 2): speed m/s, relative heading deg."""
    n_games = games.state.shape[0]
    for first in range(0, n_games, CHUNK):
        last = min(first + CHUNK, n_games)
        move_boats(rules, games, commands, first, last)
        look_for_contacts(rules, games, first, last)


@lean_kernel
def _after_the_move(rules: Rules, games: Games, first: int, last: int) -> None:
    for b in range(first, last):
        games.time_s[b] += rules.decision_s
    R.check_bounds(rules, games, first, last)
    R.check_grabs(rules, games, first, last)
    R.check_tags(rules, games, first, last)
    R.check_captures(rules, games, first, last)
    R.check_untags(rules, games, first, last)
    R.check_end(rules, games, first, last)
    check_collisions(rules, games, first, last)


@lean_kernel
def end_decision(rules: Rules, games: Games) -> None:
    """Do what follows the boats' motion: clocks, rules, collisions."""
    n_games = games.state.shape[0]
    for first in range(0, n_games, CHUNK):
        _after_the_move(rules, games, first, min(first + CHUNK, n_games))


@lean_kernel
def advance_games(rules: Rules, games: Games, wanted: Array, commands: Array) -> None:
    """Move all boats for a decision, after `begin_decision`, and apply the rules.

    Games are processed in chunks that fit into the processor's cache. The first step uses ``commands`` (B, n, 2), which
    is overwritten. In later steps the game decides anew for game-controlled boats; the others obey ``wanted``.
    """
    n_games = games.state.shape[0]
    for first in range(0, n_games, CHUNK):
        last = min(first + CHUNK, n_games)
        for step in range(rules.decision_steps):
            if step > 0:
                decide_games(rules, games, wanted, commands, first, last)
            move_boats(rules, games, commands, first, last)
            look_for_contacts(rules, games, first, last)
        _after_the_move(rules, games, first, last)


@lean_kernel
def follow_games(rules: Rules, games: Games, seen: Array) -> None:
    """Apply the rules to boats that something else has moved to ``seen`` (B, n, 4), see `motion.place_boats`."""
    n_games = games.state.shape[0]
    begin_decision(rules, games)
    for first in range(0, n_games, CHUNK):
        last = min(first + CHUNK, n_games)
        place_boats(rules, games, seen, first, last)
        look_for_contacts(rules, games, first, last)
        _after_the_move(rules, games, first, last)
