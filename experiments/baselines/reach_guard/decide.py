"""One decision for all boats of ours in a game: screen, program, exact check, else the rudder of greatest value.

The inputs of boat i are z_t = turn / full turn of this step and z_s = sqrt(speed_weight) * speed command / top speed.
With x+ the state after a candidate, the least change meets, for each pair and each way an opponent may move,

    V(x+) + dV/dpsi (psi - psi+) + dV/dv (v - v+) >= R + target,   target = max(0, e^(-response dt) min(h(x), cap)),

with the same terms of a team-mate decided for together. It counts when h(x+) >= target after it by the full model.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.filter.active_set import OPTIMAL, project
from steerclear.shield.jit import Array, BoolArray, IntArray, copy_row
from steerclear.shield.plan import BACKUP, BEST_EFFORT, HELD, LARGEST_COMMAND, NOT_COVERED, PASSED, QP
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn, thrust_after
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import clamp, turn_of_rudder
from steerclear.shield.tables.lookup import table_gradient

from ...jit import kernel
from ..batch_guard import Games
from .values import WAYS, Setup, ahead, least, margins, near_pairs, seen

ROUNDS, SWEEPS = 2, 2
"""Times the program is linearised and solved; times the boats choose backups, each knowing the others' choices."""
AIM_M, SAME = 0.01, 1e-6
"""Rows aim this much beyond the target, for the curvature of V; smaller changes of inputs are none."""
HYSTERESIS_M = 0.3
"""Value, m, by which a backup to the other side must be better."""

BACKUPS = np.array([(k / 4.0, 1.0) for k in range(5)] + [(0.0, 0.0)] + [(k / 4.0, 1.0) for k in range(-4, 0)])
"""Rudder to starboard as a share of full, and speed as a share of top speed; the first of the best is taken."""


@kernel
def _effects(setup: Setup, i: int, state: Array, command: Array, later: Array, z: Array) -> tuple[float, float]:
    """Write boat i's z (2,) and return the full turn of this step, deg, and d(v)/d(z_s), m/s."""
    params, top, row, root = setup.params[i], setup.params[i, L.MAX_SPEED], state.copy(), math.sqrt(setup.speed_weight)
    rudder = min(params[L.MAX_RUDDER], 100.0)
    full = abs(turn_of_rudder(params, thrust_after(params, state, command[0], setup.dt_s), rudder, setup.dt_s))
    full, turn = max(full, 1e-6), (later[L.HEADING] - state[L.HEADING] + 180.0) % 360.0 - 180.0
    z[0], z[1] = clamp(turn / full, -1.0, 1.0), root * clamp(command[0] / top, 0.0, 1.0)
    step = -0.1 * top if command[0] > 0.5 * top else 0.1 * top
    step_boat(params, row, command[0] + step, command[1], setup.dt_s)
    return full, (row[L.SPEED] - later[L.SPEED]) / step * top / root


@kernel
def _rows(setup: Setup, pairs: IntArray, need_m: Array, x: Array, effect: Array, z: Array) -> tuple[Array, Array]:
    """Rows C z >= d, of unit length: of pairs V >= ``need_m`` (m,), and the limits of the inputs."""
    C, d, r = np.zeros((WAYS * len(pairs) + 2 * len(z), len(z))), np.zeros(WAYS * len(pairs) + 2 * len(z)), 0
    for m in range(len(pairs)):
        i, j, first, last = pairs[m, 0], pairs[m, 1], pairs[m, 2], pairs[m, 3]
        for other in x[j, first:last]:
            slope = table_gradient(setup.tables, int(setup.table[i, j]), setup.fear_s, *seen(x[i, WAYS], other))
            row = C[r]
            for c in range(len(z)):
                row[c] = 0.0
            row[2 * i], row[2 * i + 1] = slope.own_heading * math.radians(effect[i, 0]), slope.own_speed * effect[i, 1]
            if first == WAYS:
                row[2 * j], row[2 * j + 1] = (
                    slope.other_heading * math.radians(effect[j, 0]),
                    slope.other_speed * effect[j, 1],
                )
            square, lack, most = 0.0, need_m[m] - slope.value_m, 0.0
            for c in range(len(z)):
                square += row[c] * row[c]
            length = math.sqrt(square)
            d[r] = lack
            for c in range(len(z)):
                d[r] += row[c] * z[c]
                most += abs(row[c]) * (2.0 if c % 2 == 0 else math.sqrt(setup.speed_weight))
            if length >= 1e-9 and lack + most >= 0.0:  # else no inputs can break or change it
                d[r] /= length
                for c in range(len(z)):
                    row[c] /= length
                r += 1
    for c in range(len(z)):
        for k in range(len(z)):
            C[r, k] = C[r + 1, k] = 0.0
        C[r, c], C[r + 1, c] = 1.0, -1.0
        d[r], d[r + 1] = (-1.0, -1.0) if c % 2 == 0 else (0.0, -math.sqrt(setup.speed_weight))
        r += 2
    return C[:r, : len(z)], d[:r]


@kernel
def _program(setup: Setup, game: Games, pairs: IntArray, target: Array, asked: Array, h: Array) -> bool:
    """Write commands by the least change of the inputs, and the margins after them; whether all targets are kept."""
    state, ours, sent, n = game.state, game.ours, game.sent, len(game.ours)
    z0, z, now, effect = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n), np.zeros((n, 2))
    need = np.zeros(len(target))
    for attempt in range(ROUNDS):
        x = ahead(setup, state, ours, sent, 1)
        for i in range(n):
            if not ours[i]:
                continue
            found = _effects(setup, int(i), state[i], sent[i], x[i, WAYS], now[2 * i : 2 * i + 2])
            effect[i, 0], effect[i, 1] = found
        if attempt == 0:
            copy_row(z0, now)
        for m in range(len(target)):
            need[m] = setup.radius_m + target[m] + AIM_M
        C, d = _rows(setup, pairs, need, x, effect, now)
        if project(C, d, z0, z) != OPTIMAL:
            return False
        for i in range(n):
            if not ours[i]:
                continue
            copy_row(sent[i], asked[i])
            if max(abs(z[2 * i] - z0[2 * i]), abs(z[2 * i + 1] - z0[2 * i + 1])) > SAME:
                speed = clamp(z[2 * i + 1] / math.sqrt(setup.speed_weight), 0.0, 1.0) * setup.params[i, L.MAX_SPEED]
                turn = z[2 * i] * effect[i, 0]
                sent[i, 0], sent[i, 1] = speed, command_for_turn(setup.params[i], state[i], speed, turn, setup.dt_s)
        copy_row(h, margins(setup, pairs, ahead(setup, state, ours, sent, 1)))
        kept = True
        for m in range(len(target)):
            kept = kept and h[m] >= target[m]
        if kept:
            return True
    return False


@kernel
def _follow(setup: Setup, i: int, backup: Array, row: Array) -> tuple[float, float]:
    """Move boat i's state on by ``look`` steps of a backup; returns its first command."""
    params, speed, first = setup.params[i], backup[1] * setup.params[i, L.MAX_SPEED], 0.0
    for step in range(setup.look):
        heading = command_for_turn(params, row, speed, backup[0] * setup.full_deg[i], setup.dt_s)
        first = heading if step == 0 else first
        step_boat(params, row, speed, heading, setup.dt_s)
    return speed, first


@kernel
def _take_backups(setup: Setup, game: Games, pairs: IntArray, movers: BoolArray) -> None:
    """Give the movers (n,) the backups of greatest value after ``look`` steps; others go by their commands.

    A boat changes the side it turns to, which is kept of it, only for what is clearly better.
    """
    state, sent, side = game.state, game.sent, game.memory[:, 0]
    x = ahead(setup, state, game.ours, sent, setup.look)
    for sweep in range(SWEEPS):
        for i in range(len(movers)):
            if not movers[i]:
                continue
            best, chosen = -math.inf, 0
            mine, many = np.empty_like(pairs), 0
            for m in range(len(pairs)):
                if pairs[m, 0] == i or (pairs[m, 1] == i and pairs[m, 2] == WAYS):
                    for c in range(4):
                        mine[many, c] = pairs[m, c]
                    many += 1
            mine = mine[:many]
            for k in range(len(BACKUPS)):
                copy_row(x[i, WAYS], state[i])
                _follow(setup, int(i), BACKUPS[k], x[i, WAYS])
                value = math.inf
                for margin in margins(setup, mine, x):
                    value = min(value, margin)
                value -= HYSTERESIS_M if BACKUPS[k, 0] * side[i] < 0.0 else 0.0
                if value > best:
                    best, chosen = value, k
            copy_row(x[i, WAYS], state[i])
            speed, heading = _follow(setup, int(i), BACKUPS[chosen], x[i, WAYS])
            if sweep == SWEEPS - 1:
                turn = BACKUPS[chosen, 0]
                sent[i, 0], sent[i, 1] = speed, heading
                side[i] = 1.0 if turn > 0.0 else (-1.0 if turn < 0.0 else 0.0)


@kernel
def _short(pairs: IntArray, h: Array, target: Array, movers: BoolArray) -> bool:
    """Add the boats that fall short of a target to the movers; whether there were any."""
    left, more = h.copy(), False
    for m in range(len(h)):
        left[m] -= target[m]
    low = least(pairs, left, len(movers))
    for i in range(len(movers)):
        if not movers[i] and not low[i] >= 0.0:
            movers[i] = more = True
    return more


@kernel
def decide_game(setup: Setup, game: Games) -> None:  # noqa: C901 - copies of rows, in loops that compile quickly
    """Decide for the boats of ours in one game, (n, ...) each."""
    state, wanted, ours, memory, sent, reason, certificate_m = game
    n = len(ours)
    for i in range(n):
        reason[i] = PASSED if ours[i] else NOT_COVERED
        if ours[i] and not (abs(wanted[i, 0]) <= LARGEST_COMMAND and abs(wanted[i, 1]) <= LARGEST_COMMAND):
            sent[i, 0] = sent[i, 1] = 0.0
            reason[i] = HELD
    asked, pairs = sent.copy(), near_pairs(setup, state, ours)
    target = margins(setup, pairs, ahead(setup, state, ours, sent, 0))
    for m in range(len(target)):
        target[m] = max(0.0, setup.decay * min(target[m], setup.cap_m))
    h = margins(setup, pairs, ahead(setup, state, ours, sent, 1))
    movers = np.zeros(n, np.bool_)
    moved = _short(pairs, h, target, movers)
    if moved and _program(setup, game, pairs, target, asked, h):
        for i in range(n):
            movers[i] = False
            if ours[i] and (sent[i, 0] != asked[i, 0] or sent[i, 1] != asked[i, 1]):
                reason[i] = QP
    elif moved:
        for i in range(n):
            copy_row(sent[i], asked[i])
        while moved:  # who falls short by what others do now backs away, too
            _take_backups(setup, game, pairs, movers)
            copy_row(h, margins(setup, pairs, ahead(setup, state, ours, sent, 1)))
            moved = _short(pairs, h, target, movers)
    copy_row(certificate_m, least(pairs, h, n))
    for i in range(n):
        if not ours[i]:
            continue
        if movers[i]:
            reason[i] = BACKUP if certificate_m[i] >= 0.0 else BEST_EFFORT
        elif reason[i] != QP:
            for c in range(memory.shape[1]):
                memory[i, c] = 0.0


@kernel
def decide_games(setup: Setup, games: Games) -> None:
    """`decide_game` for every game; arrays carry a leading games axis."""
    state, wanted, ours, memory, sent, reason, certificate_m = games
    for b in range(len(state)):
        decide_game(setup, Games(state[b], wanted[b], ours[b], memory[b], sent[b], reason[b], certificate_m[b]))
