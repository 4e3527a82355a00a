"""One decision for all boats of ours in a game, and for a batch of games: screen, program, check, ladder. Compiled."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.filter.active_set import OPTIMAL, project
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.plan import BACKUP, BEST_EFFORT, HELD, LARGEST_COMMAND, NOT_COVERED, PASSED, QP
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn
from steerclear.shield.platforms.step import step_boat

from ..jit import kernel
from .ladder import take_backups
from .rows import Pairs, Program, build_rows, set_inputs
from .values import WAYS, Setup, fill_margins, least_margin, mark_failing, near_pairs, run_on, set_targets

ROUNDS = 2
"""Times the program is linearised and solved before the ladder takes over."""
SAME = 1e-6
"""Input change below which the wanted command is sent."""


@kernel
def predict(setup: Setup, state: Array, ours: BoolArray, commands: Array, later: Array) -> None:
    """States after the commands, by the full model; boats not decided for stay as they are."""
    later[:] = state
    for i in range(state.shape[0]):
        if ours[i]:
            step_boat(setup.params[i], later[i], commands[i, 0], commands[i, 1], setup.dt_s)


@kernel
def _command(setup: Setup, state: Array, turn: float, speed: float, full_deg: float, i: int) -> tuple[float, float]:
    """Command that yields the inputs, through the autopilot's inverse."""
    params = setup.params[i]
    fast = min(max(speed / math.sqrt(setup.speed_weight), 0.0), 1.0) * params[L.MAX_SPEED]
    return fast, command_for_turn(params, state, fast, turn * full_deg, setup.dt_s)


@kernel
def _program(
    setup: Setup, state: Array, ours: BoolArray, pairs: Pairs, asked: Array, commands: Array, later: Array
) -> bool:
    """Nearest inputs to those asked for that keep all targets, linearised and checked; True when the check holds."""
    n = state.shape[0]
    slot, own = np.full(n, -1), 0
    for i in range(n):
        if ours[i]:
            slot[i], own = own, own + 1
    z, row = np.zeros((n, 5)), np.zeros(L.N_STATE)
    z_now, z0, answer = np.zeros(2 * own), np.zeros(2 * own), np.zeros(2 * own)
    C, d = np.zeros((WAYS * n * n + 4 * n, 2 * own)), np.zeros(WAYS * n * n + 4 * n)
    program = Program(slot, z, z_now, C, d)
    for attempt in range(ROUNDS):
        for i in range(n):
            if ours[i]:
                set_inputs(setup, state[i], commands[i], later[i], row, i, z[i])
                z_now[2 * slot[i] : 2 * slot[i] + 2] = z[i, :2]
        if attempt == 0:
            z0[:] = z_now
        rows = build_rows(setup, ours, pairs, later, program)
        if project(C[:rows], d[:rows], z0, answer) != OPTIMAL:
            return False
        for i in range(n):
            if ours[i]:
                k = 2 * slot[i]
                commands[i] = asked[i]
                if abs(answer[k] - z0[k]) > SAME or abs(answer[k + 1] - z0[k + 1]) > SAME:
                    commands[i, 0], commands[i, 1] = _command(setup, state[i], answer[k], answer[k + 1], z[i, 2], i)
        predict(setup, state, ours, commands, later)
        fill_margins(setup, ours, pairs.near, later, pairs.ways, pairs.margin)
        if mark_failing(setup, ours, pairs.near, pairs.margin, pairs.target, np.zeros(n, np.bool_)):
            return True
    return False


@kernel
def _ask(wanted: Array, ours: BoolArray, sent: Array, reason: IntArray) -> None:
    """Start from the wanted commands; a boat of ours without a usable one holds its course and stops."""
    sent[:] = wanted
    for i in range(ours.shape[0]):
        reason[i] = PASSED if ours[i] else NOT_COVERED
        if ours[i] and not (abs(wanted[i, 0]) <= LARGEST_COMMAND and abs(wanted[i, 1]) <= LARGEST_COMMAND):
            sent[i, 0], sent[i, 1], reason[i] = 0.0, 0.0, HELD


@kernel
def decide_game(
    setup: Setup,
    state: Array,
    wanted: Array,
    ours: BoolArray,
    side: Array,
    sent: Array,
    reason: IntArray,
    certificate_m: Array,
) -> None:
    """Decide for the boats of ours in one game, (n, ...) each.

    ``side`` of each boat's backup under way is kept between decisions; ``sent``, ``reason`` and ``certificate_m``, the
    least margin after the step, inf where nobody is near, are written.
    """
    n = state.shape[0]
    _ask(wanted, ours, sent, reason)
    asked, later, ways = sent.copy(), state.copy(), np.empty((n, WAYS, L.N_STATE))
    near, target, margin = np.zeros((n, n), np.bool_), np.zeros((n, n)), np.full((n, n), np.inf)
    pairs = Pairs(near, ways, target, margin)
    near_pairs(setup, state, ours, near)
    set_targets(setup, state, near, target)
    run_on(setup, state, 1, ways)
    predict(setup, state, ours, sent, later)
    fill_margins(setup, ours, near, later, ways, margin)
    movers = np.zeros(n, np.bool_)
    if not mark_failing(setup, ours, near, margin, target, movers):
        if _program(setup, state, ours, pairs, asked, sent, later):
            movers[:] = False
            for i in range(n):
                if ours[i] and (sent[i] != asked[i]).any():
                    reason[i] = QP
        else:
            sent[:] = asked
            for _ in range(n):  # who falls short by what others do now backs away, too, until nobody is added
                take_backups(setup, state, ours, near, movers, sent, side)
                predict(setup, state, ours, sent, later)
                fill_margins(setup, ours, near, later, ways, margin)
                if mark_failing(setup, ours, near, margin, target, movers):
                    break
    for i in range(n):
        certificate_m[i] = least_margin(setup, ours, near, margin, i) if ours[i] else np.inf
        if movers[i]:
            reason[i] = BACKUP if certificate_m[i] >= 0.0 else BEST_EFFORT
        elif reason[i] != QP:
            side[i] = 0.0


@kernel
def decide_games(
    setup: Setup,
    state: Array,
    wanted: Array,
    ours: BoolArray,
    side: Array,
    sent: Array,
    reason: IntArray,
    certificate_m: Array,
) -> None:
    """`decide_game` for every game; arrays carry a leading games axis."""
    for b in range(state.shape[0]):
        decide_game(setup, state[b], wanted[b], ours[b], side[b], sent[b], reason[b], certificate_m[b])
