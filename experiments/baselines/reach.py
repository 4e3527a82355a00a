"""`ReachFilter`: a safety filter from the reachability value tables alone, with the batched shield's interface.

Margins of pairs of boats are h_ij = V(x_i, x_j) - R. By the value tables, V is the distance that can be kept from now
on: against the worst an opponent can do within the adversary horizon, or with the help of a teammate. The tables do
not cover motion within a step, so opponents move in each of three ways, and the least of the three values counts.

One decision covers all own boats in a game: nominal check, program, exact check, else the rudder of greatest value. The
inputs of boat i are z_t = turn / full turn of this step and z_s = sqrt(speed_weight) * speed command / top speed.
With x+ the state after a candidate, the least change satisfies, for each pair and each way an opponent may move,

    V(x+) + dV/dpsi (psi - psi+) + dV/dv (v - v+) >= R + target,   target = max(0, e^(-response dt) min(h(x), cap)),

with the same terms of a teammate decided together. It is accepted if h(x+) >= target by the full model.
"""

from __future__ import annotations

import math
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.jit import Array, BoolArray, IntArray, copy_row, kernel
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate, command_for_turn, thrust_after
from steerclear.shield.platforms.rudder import turn_in_step
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import clamp
from steerclear.shield.tables.files import ValueTable, load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, Tables, table_gradient, table_range_m, table_value
from steerclear.shield.tables.settings import OtherMay
from steerclear.shield.workspace import BACKUP, BEST_EFFORT, HELD, LARGEST_COMMAND, LEAST_CHANGE, NOT_COVERED, PASSED

from .active_set import OPTIMAL, project
from .base import BatchFilter, Games, game_of

WAYS = 3
"""Ways an opponent may move in a step: straight on, full rudder to port, full rudder to starboard."""


class Setup(NamedTuple):
    """Constants of n boats: tables, index by pair (n, n), platform rows, teams, full turns (n,) deg, settings."""

    tables: Tables
    table: IntArray
    params: Array
    team: IntArray
    full_deg: Array
    radius_m: float
    decay: float
    cap_m: float
    dt_s: float
    fear_s: float
    speed_weight: float
    look: int


@kernel
def near_pairs(setup: Setup, state: Array, ours: BoolArray) -> IntArray:
    """Return pairs (m, 4) within their table's range: own boat i, boat j, and which of j's states of `ahead` count.

    The states are given as first and end (exclusive): the state under j's commands if both are decided together (listed
    once), every way of an opponent, or the first way of another teammate.
    """
    pairs, m = np.zeros((setup.table.size, 4), np.int64), 0
    for i, j in np.ndindex(setup.table.shape):
        teammates = setup.team[i] == setup.team[j]
        if i == j or not ours[i] or (teammates and ours[j] and j < i):
            continue
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
        if gap <= table_range_m(setup.tables, int(setup.table[i, j])):
            first, last = (WAYS, WAYS + 1) if teammates and ours[j] else (0, 1 if teammates else WAYS)
            pairs[m, 0], pairs[m, 1], pairs[m, 2], pairs[m, 3] = i, j, first, last
            m += 1
    return pairs[:m]


@kernel
def ahead(setup: Setup, state: Array, ours: BoolArray, commands: Array, steps: int) -> Array:
    """Return states (n, WAYS + 1, N_STATE) after some steps: boats as opponents, and own boats under their commands."""
    x = np.empty((len(state), WAYS + 1, L.N_STATE))
    for j, way in np.ndindex(x.shape[:2]):
        params = setup.params[j]
        copy_row(x[j, way], state[j])
        turn = float(setup.full_deg[j]) * (0.0 if way == 0 else 2.0 * way - 3.0)
        speed = state[j, L.SPEED] if way == 0 else params[L.MAX_SPEED]
        for _ in range(steps):
            if way < WAYS:
                actuate(params, x[j, way], speed, turn, setup.dt_s)
            elif ours[j]:
                step_boat(params, x[j, way], commands[j, 0], commands[j, 1], setup.dt_s)
    return x


@kernel
def seen(own: Array, other: Array) -> tuple[float, float, float, float, float, float]:
    """Return the arguments of a table: offset of the other boat, m, both headings, rad, and speeds, m/s."""
    x, y = other[L.X] - own[L.X], other[L.Y] - own[L.Y]
    return x, y, math.radians(own[L.HEADING]), math.radians(other[L.HEADING]), own[L.SPEED], other[L.SPEED]


@kernel
def margins(setup: Setup, pairs: IntArray, x: Array) -> Array:
    """Return margins (m,) of pairs in the states ``x`` of `ahead`, m."""
    h = np.full(len(pairs), np.inf)
    for r in range(len(pairs)):
        i, j, first, last = pairs[r, 0], pairs[r, 1], pairs[r, 2], pairs[r, 3]
        for other in x[j, first:last]:
            value = table_value(setup.tables, int(setup.table[i, j]), setup.fear_s, *seen(x[i, WAYS], other))
            margin = value - setup.radius_m
            if math.isnan(margin) or margin < h[r]:
                h[r] = margin
    return h


@kernel
def least(pairs: IntArray, h: Array, boats: int) -> Array:
    """Return the least (n,) of pair values (m,) for each own boat."""
    low = np.full(boats, np.inf)
    for r in range(len(pairs)):
        for i in pairs[r, : 2 if pairs[r, 2] == WAYS else 1]:
            if math.isnan(h[r]) or h[r] < low[i]:
                low[i] = h[r]
    return low


@kernel
def mark_safe(setup: Setup, state: Array, ours: BoolArray, safe: BoolArray) -> None:
    """Mark own boats whose pairs all have a value of at least the radius.

    Args:
        setup: tables and radius.
        state: (B, n, N_STATE).
        ours: (n,) own boats.
        safe: (B, n) written; False for others.
    """
    for b in range(len(state)):
        pairs = near_pairs(setup, state[b], ours)
        h = margins(setup, pairs, ahead(setup, state[b], ours, np.empty((len(ours), 2)), 0))
        low = least(pairs, h, len(ours))
        for i in range(len(ours)):
            safe[b, i] = ours[i] and low[i] >= 0.0


ROUNDS, SWEEPS = 2, 2
"""Linearisations of the program; sweeps in which boats choose backups, each knowing the others' choices."""
AIM_M, SAME = 0.01, 1e-6
"""Excess of constraints over the target, m, for the curvature of V; smallest change of inputs that counts."""
HYSTERESIS_M = 0.3
"""Value, m, by which a backup to the other side must be better."""

BACKUPS = np.array([(k / 4.0, 1.0) for k in range(5)] + [(0.0, 0.0)] + [(k / 4.0, 1.0) for k in range(-4, 0)])
"""Rudder to starboard as a share of full, and speed as a share of top speed; the first of the best is chosen."""


@kernel
def _effects(setup: Setup, i: int, state: Array, command: Array, later: Array, z: Array) -> tuple[float, float]:
    """Write boat i's z (2,) and return the full turn of this step, deg, and d(v)/d(z_s), m/s."""
    params, top, row, root = setup.params[i], setup.params[i, L.MAX_SPEED], state.copy(), math.sqrt(setup.speed_weight)
    rudder, thrust = min(params[L.MAX_RUDDER], 100.0), thrust_after(params, state, command[0], setup.dt_s)
    full = abs(turn_in_step(params, state[L.SPEED], thrust, rudder, setup.dt_s))
    full, turn = max(full, 1e-6), (later[L.HEADING] - state[L.HEADING] + 180.0) % 360.0 - 180.0
    z[0], z[1] = clamp(turn / full, -1.0, 1.0), root * clamp(command[0] / top, 0.0, 1.0)
    step = -0.1 * top if command[0] > 0.5 * top else 0.1 * top
    step_boat(params, row, command[0] + step, command[1], setup.dt_s)
    return full, (row[L.SPEED] - later[L.SPEED]) / step * top / root


@kernel
def _rows(setup: Setup, pairs: IntArray, need_m: Array, x: Array, effect: Array, z: Array) -> tuple[Array, Array]:
    """Return constraints C z >= d of unit length: V >= ``need_m`` (m,) of pairs, and the limits of the inputs."""
    n, most_speed = len(z), math.sqrt(setup.speed_weight)
    C, d, r = np.zeros((WAYS * len(pairs) + 2 * n, n)), np.zeros(WAYS * len(pairs) + 2 * n), 0
    for m in range(len(pairs)):
        i, j, first, last = pairs[m, 0], pairs[m, 1], pairs[m, 2], pairs[m, 3]
        for other in x[j, first:last]:
            slope = table_gradient(setup.tables, int(setup.table[i, j]), setup.fear_s, *seen(x[i, WAYS], other))
            row, square, lack, most = C[r], 0.0, need_m[m] - slope.value_m, 0.0
            row[:] = 0.0
            row[2 * i], row[2 * i + 1] = slope.own_heading * math.radians(effect[i, 0]), slope.own_speed * effect[i, 1]
            if first == WAYS:
                row[2 * j] = slope.other_heading * math.radians(effect[j, 0])
                row[2 * j + 1] = slope.other_speed * effect[j, 1]
            d[r] = lack
            for c in range(n):
                square += row[c] * row[c]
                d[r] += row[c] * z[c]
                most += abs(row[c]) * (2.0 if c % 2 == 0 else most_speed)
            if square >= 1e-18 and lack + most >= 0.0:  # otherwise no inputs can violate or change it
                length = math.sqrt(square)
                d[r] /= length
                row /= length
                r += 1
    C[r:] = 0.0
    for c in range(n):
        C[r, c], C[r + 1, c] = 1.0, -1.0
        d[r], d[r + 1] = (-1.0, -1.0) if c % 2 == 0 else (0.0, -most_speed)
        r += 2
    return C[:r], d[:r]


@kernel
def _program(setup: Setup, game: Games, pairs: IntArray, target: Array, asked: Array, h: Array) -> bool:
    """Write commands by the least change of inputs, and margins after them; return whether all targets hold."""
    state, ours, filtered, n = game.state, np.flatnonzero(game.ours), game.filtered, len(game.ours)
    z0, z, now, effect = np.zeros(2 * n), np.zeros(2 * n), np.zeros(2 * n), np.zeros((n, 2))
    for attempt in range(ROUNDS):
        x = ahead(setup, state, game.ours, filtered, 1)
        for i in ours:
            turn_deg, gain = _effects(setup, int(i), state[i], filtered[i], x[i, WAYS], now[2 * i : 2 * i + 2])
            effect[i, 0], effect[i, 1] = turn_deg, gain
        if attempt == 0:
            copy_row(z0, now)
        C, d = _rows(setup, pairs, setup.radius_m + target + AIM_M, x, effect, now)
        if project(C, d, z0, z) != OPTIMAL:
            return False
        for i in ours:
            copy_row(filtered[i], asked[i])
            if np.abs(z - z0)[2 * i : 2 * i + 2].max() > SAME:
                speed = clamp(z[2 * i + 1] / math.sqrt(setup.speed_weight), 0.0, 1.0) * setup.params[i, L.MAX_SPEED]
                turn = z[2 * i] * effect[i, 0]
                filtered[i, 0], filtered[i, 1] = (
                    speed,
                    command_for_turn(setup.params[i], state[i], speed, turn, setup.dt_s),
                )
        copy_row(h, margins(setup, pairs, ahead(setup, state, game.ours, filtered, 1)))
        if (h >= target).all():
            return True
    return False


@kernel
def _follow(setup: Setup, i: int, backup: Array, row: Array) -> tuple[float, float]:
    """Advance boat i's state by ``look`` steps of a backup; return its first command."""
    params, speed, first = setup.params[i], backup[1] * setup.params[i, L.MAX_SPEED], 0.0
    for step in range(setup.look):
        heading = command_for_turn(params, row, speed, backup[0] * setup.full_deg[i], setup.dt_s)
        first = heading if step == 0 else first
        step_boat(params, row, speed, heading, setup.dt_s)
    return speed, first


@kernel
def _take_backups(setup: Setup, game: Games, pairs: IntArray, movers: BoolArray) -> None:
    """Give the movers (n,) the backups of greatest value after ``look`` steps; other boats follow their commands.

    The memory holds the side to which a boat turns; it changes sides only for a clearly better backup.
    """
    state, filtered, side = game.state, game.filtered, game.memory[:, 0]
    x = ahead(setup, state, game.ours, filtered, setup.look)
    for sweep in range(SWEEPS):
        for i in np.flatnonzero(movers):
            mine = pairs[(pairs[:, 0] == i) | ((pairs[:, 1] == i) & (pairs[:, 2] == WAYS))]
            best, chosen = -math.inf, 0
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
            command = _follow(setup, int(i), BACKUPS[chosen], x[i, WAYS])
            if sweep == SWEEPS - 1:
                filtered[i, 0], filtered[i, 1], side[i] = command[0], command[1], np.sign(BACKUPS[chosen, 0])


@kernel
def _short(pairs: IntArray, left_m: Array, movers: BoolArray) -> bool:
    """Add boats with a pair below its target to the movers; return whether there were any."""
    more = ~movers & ~(least(pairs, left_m, len(movers)) >= 0.0)
    movers[:] = movers | more
    return bool(more.any())


@kernel
def decide_game(setup: Setup, game: Games) -> None:
    """Decide for the own boats in one game, arrays (n, ...)."""
    state, nominal, ours, memory, filtered, reason, safety_margin_m = game
    n = len(ours)
    for i in range(n):
        reason[i] = PASSED if ours[i] else NOT_COVERED
        if ours[i] and not (abs(nominal[i, 0]) <= LARGEST_COMMAND and abs(nominal[i, 1]) <= LARGEST_COMMAND):
            filtered[i, 0], filtered[i, 1], reason[i] = 0.0, 0.0, HELD
    asked, pairs, movers = filtered.copy(), near_pairs(setup, state, ours), np.zeros(n, np.bool_)
    now = margins(setup, pairs, ahead(setup, state, ours, filtered, 0))
    target = np.maximum(0.0, setup.decay * np.minimum(now, setup.cap_m))
    h = margins(setup, pairs, ahead(setup, state, ours, filtered, 1))
    moved = _short(pairs, h - target, movers)
    if moved and _program(setup, game, pairs, target, asked, h):
        movers[:] = False
        for i in range(n):
            if ours[i] and (filtered[i, 0] != asked[i, 0] or filtered[i, 1] != asked[i, 1]):
                reason[i] = LEAST_CHANGE
    elif moved:
        for i in range(n):
            copy_row(filtered[i], asked[i])
        while moved:  # boats below their target because of the new backups take one, too
            _take_backups(setup, game, pairs, movers)
            copy_row(h, margins(setup, pairs, ahead(setup, state, ours, filtered, 1)))
            moved = _short(pairs, h - target, movers)
    copy_row(safety_margin_m, least(pairs, h, n))
    for i in range(n):
        if ours[i] and movers[i]:
            reason[i] = BACKUP if safety_margin_m[i] >= 0.0 else BEST_EFFORT
        elif ours[i] and reason[i] != LEAST_CHANGE:
            memory[i] = 0.0


@kernel
def decide_games(setup: Setup, games: Games) -> None:
    """Run `decide_game` for every game."""
    for b in range(len(games.state)):
        decide_game(setup, game_of(games, b))


NAME = "reach"
SETTINGS = ("cbf_rate_per_s", "margin_cap_m", "speed_weight", "adversary_horizon_s", "profile", "buffer_m")
"""Settings of `ShieldConfig` that may be given with the name; separation, position error and step count too."""


class ReachFilter(BatchFilter):
    """Filter that keeps the separation promised by the value tables; see `BatchFilter`.

    Reasons are the shield's: 0 passed bit for bit, 1 changed by the program, 3 backup, 4 best effort (no rudder and no
    braking keeps the separation), 5 no usable command, so the boat holds, 6 not decided for. ``safety_margin_m`` is the
    least value after this step less the required radius, m; inf if no boat is within the tables' range. The filter does
    not avoid static obstacles or the field's edge.

    Raises:
        ConfigError: a pair of boats without a table, a fleet that does not fit, a radius beyond the tables' range, or a
            delay.
    """

    columns, needs_commands = 1, False

    @staticmethod
    def check_settings(settings: dict[str, Any]) -> None:
        """Check settings given with the name.

        Raises:
            ConfigError: a setting that this filter does not use, or a bad value.
        """
        for key in settings:
            if key not in SETTINGS:
                raise ConfigError(f"filter {NAME!r} has no setting {key!r}; it knows {', '.join(SETTINGS)}")
        ShieldConfig.of(**settings)

    def __init__(
        self, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...], team: tuple[int, ...]
    ) -> None:
        super().__init__(NAME, config, games, platforms, team)
        tables, index = _tables(self._platforms, team)
        cap_m = min((table.card.make_grid().cap_m for table in tables), default=math.inf)
        if self.radius_m >= cap_m:
            raise ConfigError(
                f"the separation to keep is {self.radius_m:g} m with buffer and position error, and the value tables "
                f"tell distances up to {cap_m:g} m; choose a smaller separation_m"
            )
        rudders = [(row, row[L.MAX_SPEED], row[L.MAX_THRUST], min(row[L.MAX_RUDDER], 100.0)) for row in self.params]
        self.setup = Setup(
            tables=stack_tables(tables),
            table=index,
            params=self.params,
            team=np.array(team, dtype=np.int64),
            full_deg=np.array([abs(turn_in_step(*rudder, config.dt_s)) for rudder in rudders]),
            radius_m=self.radius_m,
            decay=math.exp(-config.cbf_rate_per_s * config.dt_s),
            cap_m=min(config.margin_cap_m, cap_m - self.radius_m),
            dt_s=config.dt_s,
            fear_s=min(config.effective_adversary_horizon_s, WHOLE_S),
            speed_weight=config.speed_weight,
            look=max((round(table.card.dt_s / config.dt_s) for table in tables), default=1),
        )

    def _decide(self, games: Games) -> None:
        decide_games(self.setup, games)


def _tables(platforms: list[Platform], team: tuple[int, ...]) -> tuple[list[ValueTable], IntArray]:
    """Return the tables of all pairs, each once, and the table index of each pair (n, n)."""
    index, found = np.full((len(team), len(team)), -1), dict[tuple[Platform, Platform, OtherMay], ValueTable]()
    for i, j in permutations(range(len(team)), 2):
        key = platforms[i], platforms[j], OtherMay.COOPERATIVE if team[i] == team[j] else OtherMay.WORST_CASE
        try:
            found.setdefault(key, load_table(*key))
        except TableError as error:
            raise ConfigError(f"filter {NAME!r}: {error}") from error
        index[i, j] = list(found).index(key)
    return list(found.values()), index
