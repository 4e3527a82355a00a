"""One decision of a filter for all boats of ours in a game, and for a batch of games. Compiled."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.filter.program import holds
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from ..jit import kernel
from .barriers import DISTANCE
from .inputs import command_of_inputs
from .program import RELAXED, SOLVED, UNSOLVED, solve
from .rows import FACETS, Setup, least, limit_rows, pair_row, wanted_inputs

PASSED = 0
SAME = 1e-9
"""Inputs this near to the wanted ones are the wanted ones."""


@kernel
def _barrier_rows(
    setup: Setup, state: Array, unit: Array, slot: IntArray, C: Array, d: Array, pair: IntArray, out: Array
) -> int:
    """Rows that some input could break, and each own boat's clearance in ``out``; returns how many rows."""
    count, n = 0, state.shape[0]
    for i in range(n):
        for j in range(n):
            both = slot[i] >= 0 and slot[j] >= 0
            if slot[i] < 0 or i == j:
                continue
            gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]) - setup.radius_m
            out[i] = min(out[i], gap)
            if both and j < i:
                continue
            gains = 0.5 * (setup.gains[i] + setup.gains[j]) if both else setup.gains[i]
            a, b, c, e, need = pair_row(setup, state, unit, i, j, both, gains)
            worst = least(setup, state[i], i, a, b) + (least(setup, state[j], j, c, e) if both else 0.0)
            if worst >= need:
                continue
            C[count, 2 * slot[i]], C[count, 2 * slot[i] + 1] = a, b
            if both:
                C[count, 2 * slot[j]], C[count, 2 * slot[j] + 1] = c, e
            d[count], pair[count, 0], pair[count, 1] = need, i, j if both else i
            count += 1
    return count


@kernel
def _command(setup: Setup, state: Array, wanted: Array, i: int, z: Array, unit: Array) -> tuple[float, float]:
    """Speed and relative heading of boat i that yield the inputs z."""
    if setup.kind != DISTANCE:
        return command_of_inputs(setup.params[i], setup.limits[i], state, z[0] * unit[0], z[1] * unit[1], setup.dt_s)
    speed = math.hypot(z[0], z[1])
    if speed <= SAME:
        return 0.0, wanted[1]
    return speed, wrap_degrees(math.degrees(math.atan2(z[0], z[1])) - state[L.HEADING])


@kernel
def decide_game(
    setup: Setup, state: Array, wanted: Array, ours: BoolArray, sent: Array, reason: IntArray, clear_m: Array
) -> None:
    """Decide for the boats of ours; ``sent`` starts as ``wanted``, ``reason`` as `PASSED`, ``clear_m`` as inf."""
    n, own = state.shape[0], 0
    slot, unit, start = np.full(n, -1), np.ones((n, 2)), np.zeros(2 * n)
    for i in range(n):
        if ours[i]:
            start[2 * own], start[2 * own + 1], unit[i, 0], unit[i, 1] = wanted_inputs(setup, state[i], wanted[i], i)
            slot[i], own = own, own + 1
    z0 = start[: 2 * own]
    rows, need, pair = np.zeros((own * n, 2 * own)), np.zeros(own * n), np.zeros((own * n, 2), np.int64)
    count = _barrier_rows(setup, state, unit, slot, rows, need, pair, clear_m)
    if holds(rows[:count], need[:count], z0, SAME):
        return
    met, loose = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for r in range(count):
        met[pair[r, 0]] = met[pair[r, 1]] = True
    hard, at = met.sum() * (FACETS if setup.kind == DISTANCE else 4), 0
    C, d = np.zeros((hard + count, 2 * own)), np.zeros(hard + count)
    C[hard:], d[hard:] = rows[:count], need[:count]
    for i in np.flatnonzero(met):
        at = limit_rows(setup, state[i], i, 2 * slot[i], C, d, at, state[i, L.HEADING] + wanted[i, 1])
    z, slack = z0.copy(), np.zeros(count)
    status = solve(C, d, hard, z0, z, slack)
    for r in range(count):
        for i in pair[r]:
            loose[i] = loose[i] or slack[r] > SAME
    for i in np.flatnonzero(met):
        k = 2 * slot[i]
        reason[i] = UNSOLVED if status == UNSOLVED else RELAXED if loose[i] else PASSED
        if status == UNSOLVED:
            sent[i, 0] = 0.0
        elif abs(z[k] - z0[k]) > SAME or abs(z[k + 1] - z0[k + 1]) > SAME:
            sent[i, 0], sent[i, 1] = _command(setup, state[i], wanted[i], i, z[k : k + 2], unit[i])
            reason[i] = max(reason[i], SOLVED)


@kernel
def decide_games(
    setup: Setup, state: Array, wanted: Array, ours: BoolArray, sent: Array, reason: IntArray, clear_m: Array
) -> None:
    """`decide_game` for every game; arrays carry a leading games axis."""
    sent[:], reason[:], clear_m[:] = wanted, PASSED, np.inf
    for b in range(state.shape[0]):
        decide_game(setup, state[b], wanted[b], ours[b], sent[b], reason[b], clear_m[b])
