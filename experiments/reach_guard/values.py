"""Margins of pairs of boats: h_ij = V(x_i, x_j) - R, V the distance that can be kept from now on by the value tables.

It is V against the worst an opponent can do for as long as it is feared, or with the help of a team-mate. Within a
step, of which the tables say nothing, opponents move in each of three ways, and the least of the three values counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.tables.lookup import Tables, table_range_m, table_value

from ..jit import kernel

WAYS = 3
"""Ways an opponent may move in a step: straight on, and with full rudder to port and to starboard."""


class Setup(NamedTuple):
    """Constants of n boats: tables, that of each pair (n, n), platform rows, teams, full turns (n,) deg; settings."""

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
    hysteresis_m: float
    look: int


@kernel
def joint(setup: Setup, ours: BoolArray, i: int, j: int) -> bool:
    """Whether both boats of the pair are decided for together."""
    return ours[i] and ours[j] and setup.team[i] == setup.team[j]


@kernel
def near_pairs(setup: Setup, state: Array, ours: BoolArray) -> BoolArray:
    """Pairs (n, n) of a boat of ours with another within their table's range."""
    near = np.zeros(setup.table.shape, np.bool_)
    for i, j in np.ndindex(near.shape):
        if ours[i] and i != j and not (j < i and joint(setup, ours, i, j)):
            gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
            near[i, j] = gap <= table_range_m(setup.tables, int(setup.table[i, j]))
            near[j, i] = near[i, j] if joint(setup, ours, i, j) else near[j, i]
    return near


@kernel
def ahead(setup: Setup, state: Array, ours: BoolArray, commands: Array, steps: int) -> Array:
    """States (n, WAYS + 1, N_STATE) of boats after some steps: as opponents, and, of ours, under their commands."""
    x = np.empty((len(state), WAYS + 1, L.N_STATE))
    for j, way in np.ndindex(x.shape[:2]):
        x[j, way], params = state[j], setup.params[j]
        turn = float(setup.full_deg[j]) * (0.0 if way == 0 else 2.0 * way - 3.0)
        speed = state[j, L.SPEED] if way == 0 else params[L.MAX_SPEED]
        for _ in range(steps):
            if way < WAYS:
                actuate(params, x[j, way], speed, turn, setup.dt_s)
            elif ours[j]:
                step_boat(params, x[j, way], commands[j, 0], commands[j, 1], setup.dt_s)
    return x


@kernel
def others(setup: Setup, ours: BoolArray, i: int, j: int, x: Array) -> Array:
    """States (k, N_STATE) of boat j in ``x``, see `ahead`, the worst of which counts for boat i."""
    if joint(setup, ours, i, j):
        return x[j, WAYS:]
    return x[j, :WAYS] if setup.team[i] != setup.team[j] else x[j, :1]


@kernel
def seen(own: Array, other: Array) -> tuple[float, float, float, float, float, float]:
    """What a table is asked with: offset of the other boat, m, both headings, rad, and speeds, m/s."""
    x, y = other[L.X] - own[L.X], other[L.Y] - own[L.Y]
    return x, y, math.radians(own[L.HEADING]), math.radians(other[L.HEADING]), own[L.SPEED], other[L.SPEED]


@kernel
def margins(setup: Setup, ours: BoolArray, near: BoolArray, x: Array, of: int) -> Array:
    """Margins (n, n) of near pairs in the states ``x``, inf of others; those of boat ``of`` only, unless it is -1."""
    h = np.full(near.shape, np.inf)
    for i, j in np.ndindex(near.shape):
        both = joint(setup, ours, i, j)
        if not near[i, j] or (both and j < i) or (of >= 0 and of != i and not (both and of == j)):
            continue
        for other in others(setup, ours, i, j, x):
            value = table_value(setup.tables, int(setup.table[i, j]), setup.fear_s, *seen(x[i, WAYS], other))
            h[i, j] = min(h[i, j], value - setup.radius_m)
        h[j, i] = h[i, j] if both else h[j, i]
    return h
