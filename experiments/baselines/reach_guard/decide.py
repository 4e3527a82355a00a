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
from steerclear.shield.jit import Array, BoolArray, IntArray
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
            row[:] = 0.0
            row[2 * i], row[2 * i + 1] = slope.own_heading * math.radians(effect[i, 0]), slope.own_speed * effect[i, 1]
            if first == WAYS:
                row[2 * j], row[2 * j + 1] = (
                    slope.other_heading * math.radians(effect[j, 0]),
                    slope.other_speed * effect[j, 1],
                )
            length, lack, most = math.sqrt((row * row).sum()), need_m[m] - slope.value_m, 0.0
            d[r] = lack
            for c in range(len(z)):
                d[r] += row[c] * z[c]
                most += abs(row[c]) * (2.0 if c % 2 == 0 else math.sqrt(setup.speed_weight))
            if length >= 1e-9 and lack + most >= 0.0:  # else no inputs can break or change it
                d[r] /= length
                row /= length
                r += 1
    for c in range(len(z)):
        C[r : r + 2] = 0.0
        C[r, c], C[r + 1, c] = 1.0, -1.0
        d[r], d[r + 1] = (-1.0, -1.0) if c % 2 == 0 else (0.0, -math.sqrt(setup.speed_weight))
        r += 2
    return C[:r], d[:r]


@kernel
def _program(setup: Setup, game: Games, pairs: IntArray, target: Array, asked: Array, h: Array) -> bool:
    """Write commands by the least change of the inputs, and the margins after them; whether all targets are kept."""
    state, ours, sent, n = game.state, game.ours, game.sent, len(game.ours)
    z0, z, now, effect = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n), np.zeros((n, 2))
    for attempt in range(ROUNDS):
        x = ahead(setup, state, ours, sent, 1)
        for i in np.flatnonzero(ours):
            found = _effects(setup, int(i), state[i], sent[i], x[i, WAYS], now[2 * i : 2 * i + 2])
            effect[i, 0], effect[i, 1] = found
        if attempt == 0:
            z0[:] = now
        C, d = _rows(setup, pairs, setup.radius_m + target + AIM_M, x, effect, now)
        if project(C, d, z0, z) != OPTIMAL:
            return False
        for i in np.flatnonzero(ours):
            sent[i] = asked[i]
            if np.abs(z - z0)[2 * i : 2 * i + 2].max() > SAME:
                speed = clamp(z[2 * i + 1] / math.sqrt(setup.speed_weight), 0.0, 1.0) * setup.params[i, L.MAX_SPEED]
                turn = z[2 * i] * effect[i, 0]
                sent[i, 0], sent[i, 1] = speed, command_for_turn(setup.params[i], state[i], speed, turn, setup.dt_s)
        h[:] = margins(setup, pairs, ahead(setup, state, ours, sent, 1))
        if (h >= target).all():
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
        for i in np.flatnonzero(movers):
            best, chosen = -math.inf, 0
            mine = pairs[(pairs[:, 0] == i) | ((pairs[:, 1] == i) & (pairs[:, 2] == WAYS))]
            for k in range(len(BACKUPS)):
                x[i, WAYS] = state[i]
                _follow(setup, int(i), BACKUPS[k], x[i, WAYS])
                value = margins(setup, mine, x).min()
                value -= HYSTERESIS_M if BACKUPS[k, 0] * side[i] < 0.0 else 0.0
                if value > best:
                    best, chosen = value, k
            x[i, WAYS] = state[i]
            speed, heading = _follow(setup, int(i), BACKUPS[chosen], x[i, WAYS])
            if sweep == SWEEPS - 1:
                sent[i, 0], sent[i, 1], side[i] = speed, heading, np.sign(BACKUPS[chosen, 0])


@kernel
def decide_game(setup: Setup, game: Games) -> None:
    """Decide for the boats of ours in one game, (n, ...) each."""
    state, wanted, ours, memory, sent, reason, certificate_m = game
    reason[:] = np.where(ours, PASSED, NOT_COVERED)
    for i in np.flatnonzero(ours):
        if not (np.abs(wanted[i]) <= LARGEST_COMMAND).all():
            sent[i], reason[i] = 0.0, HELD
    n, asked, pairs = len(ours), sent.copy(), near_pairs(setup, state, ours)
    now = margins(setup, pairs, ahead(setup, state, ours, sent, 0))
    target = np.maximum(0.0, setup.decay * np.minimum(now, setup.cap_m))
    h = margins(setup, pairs, ahead(setup, state, ours, sent, 1))
    movers = ~(least(pairs, h - target, n) >= 0.0)
    if movers.any() and _program(setup, game, pairs, target, asked, h):
        movers[:] = False
        for i in np.flatnonzero(ours):
            reason[i] = QP if (sent[i] != asked[i]).any() else reason[i]
    elif movers.any():
        sent[:], added = asked, movers
        while added.any():  # who falls short by what others do now backs away, too
            _take_backups(setup, game, pairs, movers)
            h[:] = margins(setup, pairs, ahead(setup, state, ours, sent, 1))
            added = ~((least(pairs, h - target, n) >= 0.0) | movers)
            movers = movers | added
    certificate_m[:] = least(pairs, h, n)
    for i in np.flatnonzero(ours):
        if movers[i]:
            reason[i] = BACKUP if certificate_m[i] >= 0.0 else BEST_EFFORT
        elif reason[i] != QP:
            memory[i] = 0.0


@kernel
def decide_games(setup: Setup, games: Games) -> None:
    """`decide_game` for every game; arrays carry a leading games axis."""
    state, wanted, ours, memory, sent, reason, certificate_m = games
    for b in range(len(state)):
        decide_game(setup, Games(state[b], wanted[b], ours[b], memory[b], sent[b], reason[b], certificate_m[b]))
