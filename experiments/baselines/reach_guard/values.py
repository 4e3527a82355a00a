"""Margins of pairs of boats: h_ij = V(x_i, x_j) - R, V the distance that can be kept from now on by the value tables.

It is V against the worst an opponent can do for as long as it is feared, or with the help of a team-mate. Within a
step, of which the tables say nothing, opponents move in each of three ways, and the least of the three values counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray, copy_row
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.tables.lookup import Tables, table_range_m, table_value

from ...jit import kernel

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
    look: int


@kernel
def near_pairs(setup: Setup, state: Array, ours: BoolArray) -> IntArray:
    """Pairs (m, 4) within their table's range: boat i of ours, boat j, and which of j's states of `ahead` count.

    These are, from the first to before the last: the one under its commands, if both are decided for together (which
    is a pair once), every way of an opponent, and the first of another team-mate.
    """
    pairs, m = np.zeros((setup.table.size, 4), np.int64), 0
    for i, j in np.ndindex(setup.table.shape):
        mates = setup.team[i] == setup.team[j]
        if i == j or not ours[i] or (mates and ours[j] and j < i):
            continue
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
        if gap <= table_range_m(setup.tables, int(setup.table[i, j])):
            first, last = (WAYS, WAYS + 1) if mates and ours[j] else (0, 1 if mates else WAYS)
            pairs[m, 0], pairs[m, 1], pairs[m, 2], pairs[m, 3] = i, j, first, last
            m += 1
    return pairs[:m]


@kernel
def ahead(setup: Setup, state: Array, ours: BoolArray, commands: Array, steps: int) -> Array:
    """States (n, WAYS + 1, N_STATE) of boats after some steps: as opponents, and, of ours, under their commands."""
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
    """What a table is asked with: offset of the other boat, m, both headings, rad, and speeds, m/s."""
    x, y = other[L.X] - own[L.X], other[L.Y] - own[L.Y]
    return x, y, math.radians(own[L.HEADING]), math.radians(other[L.HEADING]), own[L.SPEED], other[L.SPEED]


@kernel
def margins(setup: Setup, pairs: IntArray, x: Array) -> Array:
    """Margins (m,) of pairs in the states ``x`` of `ahead`, m."""
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
    """Least (n,) of what is given of pairs, (m,), for the boats of ours in them."""
    low = np.full(boats, np.inf)
    for r in range(len(pairs)):
        for i in pairs[r, : 2 if pairs[r, 2] == WAYS else 1]:
            if math.isnan(h[r]) or h[r] < low[i]:
                low[i] = h[r]
    return low
