"""The compiled entry points: one team of one game, and one team of every game of a batch."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array, IntArray, lean_kernel

from .attack import HARD_REACH_M, easy_attack, field_attack
from .defend import hard, hard_defend, medium_defend
from .layout import MEDIUM_REACH, Behaviour, Game
from .paths import easy_defend, random_walk, waypoints
from .ram import ram

# plain integers: the kernels' constants must be types numba caches
RANDOM, RAMMER, WAYPOINTS = int(Behaviour.RANDOM), int(Behaviour.RAMMER), int(Behaviour.WAYPOINTS)
EASY_ATTACK, EASY_DEFEND = int(Behaviour.EASY_ATTACK), int(Behaviour.EASY_DEFEND)
MEDIUM_ATTACK, MEDIUM_DEFEND = int(Behaviour.MEDIUM_ATTACK), int(Behaviour.MEDIUM_DEFEND)
HARD, HARD_ATTACK = int(Behaviour.HARD), int(Behaviour.HARD_ATTACK)
HARD_DEFEND = int(Behaviour.HARD_DEFEND)


@lean_kernel
def command_boat(
    game: Game, boat: int, behaviour: int, memory: Array, given: Array, streams: np.ndarray, slot: int
) -> tuple[float, float]:
    """Speed m/s and relative heading deg of one boat under its behaviour; advances its memory and stream."""
    if behaviour == MEDIUM_ATTACK:
        return field_attack(game, boat, game.field[MEDIUM_REACH], False)
    if behaviour == MEDIUM_DEFEND:
        return medium_defend(game, boat)
    if behaviour == EASY_ATTACK:
        return easy_attack(game, boat, memory)
    if behaviour == EASY_DEFEND:
        return easy_defend(game, boat, memory)
    if behaviour == HARD:
        return hard(game, boat)
    if behaviour == HARD_ATTACK:
        return field_attack(game, boat, HARD_REACH_M, True)
    if behaviour == HARD_DEFEND:
        return hard_defend(game, boat)
    if behaviour == RAMMER:
        return ram(game, boat)
    if behaviour == WAYPOINTS:
        return waypoints(game, boat, memory, given, streams, slot)
    if behaviour == RANDOM:
        return random_walk(game, boat, memory, streams, slot)
    return 0.0, 0.0


@lean_kernel
def command_team(
    codes: IntArray, boats: IntArray, memory: Array, given: Array, streams: np.ndarray, game: Game, out: Array
) -> None:
    """Commands of the boats of one team in one game, into ``out`` (n_team, 2): speed m/s, relative heading deg.

    Args:
        codes: (n_team,) ``Behaviour`` of each boat.
        boats: (n_team,) their numbers among all boats.
        memory: (n_team, N_MEMORY), advanced in place.
        given: (n_team, k, 2) waypoints in m; k = 0 for random ones.
        streams: (n_team,) uint64 random streams, advanced in place.
        game: what is seen of it.
        out: (n_team, 2), written.
    """
    for slot in range(boats.size):
        speed, heading = command_boat(game, boats[slot], codes[slot], memory[slot], given[slot], streams, slot)
        out[slot, 0] = speed
        out[slot, 1] = heading


@lean_kernel
def command_batch(
    codes: IntArray, boats: IntArray, memory: Array, given: Array, streams: np.ndarray, games: Game, out: Array
) -> None:
    """``command_team`` for every game: the same arguments, with a leading axis of games.

    ``boats`` and ``given`` are the same in all games and have none, nor have ``limits``, ``team``, ``flag_home`` and
    ``field`` of the games.
    """
    for g in range(games.state.shape[0]):
        game = Game(
            games.state[g],
            games.limits,
            games.team,
            games.is_tagged[g],
            games.has_flag[g],
            games.on_side[g],
            games.flag_home,
            games.flag_position[g],
            games.field,
        )
        command_team(codes[g], boats, memory[g], given, streams[g], game, out[g])
