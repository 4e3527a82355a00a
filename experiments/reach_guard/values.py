"""Margins of pairs of boats: the value tables one step on, less the radius to keep.

Boat i's margin to boat j is h_ij = V(x_i, x_j) - R, V the distance that can be kept from now on: against the worst an
opponent can do for as long as it is feared, with the help of a team-mate. Opponents move on by one step in each of
three ways, straight and with full rudder to either side, and the least of the three values counts: the tables say what
the worst opponent does from then on, not what it does within this step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate
from steerclear.shield.platforms.usv import turn_of_rudder
from steerclear.shield.tables.lookup import Gradient, Tables, table_gradient, table_range_m, table_value

from ..jit import kernel

WAYS = 3
"""Ways an opponent may move in a step: straight, to port, to starboard."""


class Setup(NamedTuple):
    """Constants of a fleet of n boats: tables, table of each pair (n, n; -1 on the diagonal), and settings."""

    tables: Tables
    table: IntArray
    params: Array
    team: IntArray
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
def near_pairs(setup: Setup, state: Array, ours: BoolArray, near: BoolArray) -> None:
    """Mark pairs (n, n) within their table's range; pairs decided for together once, at the smaller index."""
    n = state.shape[0]
    for i in range(n):
        for j in range(n):
            near[i, j] = False
            if i != j and ours[i] and not (j < i and joint(setup, ours, i, j)):
                gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
                near[i, j] = gap <= table_range_m(setup.tables, setup.table[i, j])


@kernel
def run_on(setup: Setup, state: Array, steps: int, ways: Array) -> None:
    """Write where every boat is after some steps, should it be an opponent: (n, WAYS, N_STATE)."""
    for j in range(state.shape[0]):
        params = setup.params[j]
        full = turn_of_rudder(params, params[L.MAX_THRUST], min(params[L.MAX_RUDDER], 100.0), setup.dt_s)
        for way in range(WAYS):
            ways[j, way] = state[j]
            turn = full * (0.0 if way == 0 else 2.0 * way - 3.0)
            speed = state[j, L.SPEED] if way == 0 else params[L.MAX_SPEED]
            for _ in range(steps):
                actuate(params, ways[j, way], speed, turn, setup.dt_s)


@kernel
def _seen_from(own: Array, other: Array) -> tuple[float, float, float, float, float, float]:
    """What a table is asked with: offset of the other boat, m, both headings, rad, and speeds, m/s."""
    return (
        other[L.X] - own[L.X],
        other[L.Y] - own[L.Y],
        math.radians(own[L.HEADING]),
        math.radians(other[L.HEADING]),
        own[L.SPEED],
        other[L.SPEED],
    )


@kernel
def value_of(setup: Setup, i: int, j: int, own: Array, other: Array) -> float:
    """V of the pair, m."""
    return table_value(setup.tables, setup.table[i, j], setup.fear_s, *_seen_from(own, other))


@kernel
def slope_of(setup: Setup, i: int, j: int, own: Array, other: Array) -> Gradient:
    """V of the pair and its derivatives."""
    return table_gradient(setup.tables, setup.table[i, j], setup.fear_s, *_seen_from(own, other))


@kernel
def margin_of(setup: Setup, ours: BoolArray, i: int, j: int, later: Array, ways: Array) -> float:
    """Margin of the pair in the states ``later`` (n, N_STATE), opponents moved on in the worst of their ``ways``."""
    if joint(setup, ours, i, j):
        return value_of(setup, i, j, later[i], later[j]) - setup.radius_m
    least = value_of(setup, i, j, later[i], ways[j, 0])
    if setup.team[i] != setup.team[j]:
        for way in range(1, WAYS):
            least = min(least, value_of(setup, i, j, later[i], ways[j, way]))
    return least - setup.radius_m


@kernel
def set_targets(setup: Setup, state: Array, near: BoolArray, target: Array) -> None:
    """Margin each pair must keep in this step: h(x+) >= decay * min(h(x), cap), at least 0."""
    n = state.shape[0]
    for i in range(n):
        for j in range(n):
            if near[i, j]:
                now = value_of(setup, i, j, state[i], state[j]) - setup.radius_m
                target[i, j] = max(0.0, setup.decay * min(now, setup.cap_m))


@kernel
def fill_margins(setup: Setup, ours: BoolArray, near: BoolArray, later: Array, ways: Array, margin: Array) -> None:
    """Margins (n, n) of the near pairs."""
    n = near.shape[0]
    for i in range(n):
        for j in range(n):
            if near[i, j]:
                margin[i, j] = margin_of(setup, ours, i, j, later, ways)


@kernel
def mark_failing(
    setup: Setup, ours: BoolArray, near: BoolArray, margin: Array, target: Array, failing: BoolArray
) -> bool:
    """Add the boats of pairs short of their target to ``failing`` (n,); True when there was none to add."""
    n, same = near.shape[0], True
    for i in range(n):
        for j in range(n):
            if near[i, j] and not margin[i, j] >= target[i, j]:
                same = same and failing[i]
                failing[i] = True
                if joint(setup, ours, i, j):
                    same = same and failing[j]
                    failing[j] = True
    return same


@kernel
def least_margin(setup: Setup, ours: BoolArray, near: BoolArray, margin: Array, i: int) -> float:
    """Least margin of boat i over its pairs, inf without any."""
    least = math.inf
    for j in range(near.shape[0]):
        if near[i, j]:
            least = min(least, margin[i, j])
        if near[j, i] and joint(setup, ours, i, j):
            least = min(least, margin[j, i])
    return least
