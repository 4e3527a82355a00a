"""One decision of a filter for all boats of ours in a game, and for a batch of games. Compiled."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from ..jit import kernel
from .barriers import DISTANCE
from .inputs import command_of_inputs
from .program import RELAXED, SOLVED, UNSOLVED, holds, solve
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
def _stack(
    setup: Setup, state: Array, rows: Array, need: Array, pair: IntArray, slot: IntArray, corner_deg: Array
) -> tuple[Array, Array, int]:
    """Limits of the boats that stand in a row, then the rows."""
    n = slot.shape[0]
    met = np.zeros(n, np.bool_)
    for r in range(rows.shape[0]):
        met[pair[r, 0]] = met[pair[r, 1]] = True
    hard = met.sum() * (FACETS if setup.kind == DISTANCE else 4)
    C, d = np.zeros((hard + rows.shape[0], rows.shape[1])), np.zeros(hard + rows.shape[0])
    at = 0
    for i in range(n):
        if met[i]:
            at = limit_rows(setup, state[i], i, 2 * slot[i], C, d, at, corner_deg[i])
    C[hard:], d[hard:] = rows, need
    return C, d, hard


@kernel
def _command(setup: Setup, state: Array, wanted: Array, i: int, z: Array, unit: Array) -> tuple[float, float]:
    """Speed and relative heading of boat i that yield the inputs z."""
    if setup.kind == DISTANCE:
        speed = math.hypot(z[0], z[1])
        if speed <= SAME:
            return 0.0, wanted[1]
        return speed, wrap_degrees(math.degrees(math.atan2(z[0], z[1])) - state[L.HEADING])
    return command_of_inputs(setup.params[i], setup.limits[i], state, z[0] * unit[0], z[1] * unit[1], setup.dt_s)


@kernel
def _answer(
    setup: Setup,
    state: Array,
    wanted: Array,
    i: int,
    start: Array,
    z: Array,
    unit: Array,
    code: int,
    sent: Array,
) -> int:
    """Write boat i's command; returns why it is what it is, the code for one that is the wanted one."""
    if code == UNSOLVED:
        sent[0], sent[1] = 0.0, wanted[1]
        return UNSOLVED
    if abs(z[0] - start[0]) <= SAME and abs(z[1] - start[1]) <= SAME:
        return code
    sent[0], sent[1] = _command(setup, state, wanted, i, z, unit)
    return max(code, SOLVED)


@kernel
def _ask(
    setup: Setup, state: Array, wanted: Array, ours: BoolArray, slot: IntArray, unit: Array, corner_deg: Array
) -> Array:
    """Write each own boat's place in the program, units and wanted course; returns the wanted inputs of them all."""
    start, own = np.zeros(2 * state.shape[0]), 0
    for i in range(state.shape[0]):
        slot[i] = own if ours[i] else -1
        if ours[i]:
            one, two, unit[i, 0], unit[i, 1] = wanted_inputs(setup, state[i], wanted[i], i)
            start[2 * own], start[2 * own + 1] = one, two
            corner_deg[i] = state[i, L.HEADING] + wanted[i, 1]
            own += 1
    return start[: 2 * own]


@kernel
def decide_game(
    setup: Setup, state: Array, wanted: Array, ours: BoolArray, sent: Array, reason: IntArray, clear_m: Array
) -> None:
    """Decide for the boats of ours; ``sent`` starts as ``wanted``, ``reason`` as `PASSED`, ``clear_m`` as inf."""
    n = state.shape[0]
    slot, unit, corner_deg = np.empty(n, np.int64), np.ones((n, 2)), np.zeros(n)
    z0 = _ask(setup, state, wanted, ours, slot, unit, corner_deg)
    most = z0.size // 2 * n
    rows, need, pair = np.zeros((most, z0.size)), np.zeros(most), np.zeros((most, 2), np.int64)
    count = _barrier_rows(setup, state, unit, slot, rows, need, pair, clear_m)
    if holds(rows[:count], need[:count], z0, SAME):
        return
    C, d, hard = _stack(setup, state, rows[:count], need[:count], pair, slot, corner_deg)
    z, slack = z0.copy(), np.zeros(count)
    status = solve(C, d, hard, z0, z, slack)
    met, loose = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for r in range(count):
        for i in pair[r]:
            met[i], loose[i] = True, loose[i] or slack[r] > SAME
    for i in np.flatnonzero(met):
        k = 2 * slot[i]
        start, answer = z0[k : k + 2], z[k : k + 2]
        code = UNSOLVED if status == UNSOLVED else (RELAXED if loose[i] else PASSED)
        reason[i] = _answer(setup, state[i], wanted[i], i, start, answer, unit[i], code, sent[i])


@kernel
def decide_games(
    setup: Setup, state: Array, wanted: Array, ours: BoolArray, sent: Array, reason: IntArray, clear_m: Array
) -> None:
    """`decide_game` for every game; arrays carry a leading games axis."""
    sent[:], reason[:], clear_m[:] = wanted, PASSED, np.inf
    for b in range(state.shape[0]):
        decide_game(setup, state[b], wanted[b], ours[b], sent[b], reason[b], clear_m[b])
