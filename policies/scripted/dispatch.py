"""The compiled entry points: one team of one game, and one team of every game of a batch."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray, lean_kernel

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
    codes: IntArray,
    boats: IntArray,
    memory: Array,
    given: Array,
    streams: np.ndarray,
    field: Array,
    limits: Array,
    team: IntArray,
    state: Array,
    is_tagged: BoolArray,
    has_flag: BoolArray,
    on_side: BoolArray,
    flag_home: Array,
    flag_position: Array,
    out: Array,
) -> None:
    """Commands of the boats of one team in one game, into ``out`` (n_team, 2): speed m/s, relative heading deg.

    Args:
        codes: (n_team,) ``Behaviour`` of each boat.
        boats: (n_team,) their numbers among all boats.
        memory: (n_team, N_MEMORY), advanced in place.
        given: (n_team, k, 2) waypoints in m; k = 0 for random ones.
        streams: (n_team,) uint64 random streams, advanced in place.
        field: (N_FIELD,).
        limits: (n, N_LIMIT).
        team: (n,) 0 blue, 1 red.
        state: (n, N_STATE).
        is_tagged: (n,).
        has_flag: (n,).
        on_side: (n,).
        flag_home: (2, 2) m.
        flag_position: (2, 2) m.
        out: (n_team, 2), written.
    """
    game = Game(state, limits, team, is_tagged, has_flag, on_side, flag_home, flag_position, field)
    for slot in range(boats.size):
        speed, heading = command_boat(game, boats[slot], codes[slot], memory[slot], given[slot], streams, slot)
        out[slot, 0] = speed
        out[slot, 1] = heading


@lean_kernel
def command_batch(
    codes: IntArray,
    boats: IntArray,
    memory: Array,
    given: Array,
    streams: np.ndarray,
    field: Array,
    limits: Array,
    team: IntArray,
    state: Array,
    is_tagged: BoolArray,
    has_flag: BoolArray,
    on_side: BoolArray,
    flag_home: Array,
    flag_position: Array,
    out: Array,
) -> None:
    """``command_team`` for every game: the same arguments, with a leading axis of games.

    ``boats``, ``given``, ``field``, ``limits``, ``team`` and ``flag_home`` are the same in all games and have none.
    """
    for g in range(state.shape[0]):
        command_team(
            codes[g], boats, memory[g], given, streams[g], field, limits, team, state[g], is_tagged[g], has_flag[g],
            on_side[g], flag_home, flag_position[g], out[g],
        )  # fmt: skip
