"""Value iteration of one range of a grid, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import Array, BoolArray, kernel
from .grid import N_BETA, N_OTHER, N_OWN, N_PSI, blend, even_place, rho_node, rho_place

TWO_PI = 2.0 * math.pi
SNAP = 1e-7
"""Places this near a node are put on it (a share of a cell): turns that fit the grid then cause no blur."""


@kernel
def snapped(place: tuple[int, float]) -> tuple[int, float]:
    """The place, moved onto a node when within rounding of it."""
    if place[1] < SNAP:
        return place[0], 0.0
    if place[1] > 1.0 - SNAP:
        return place[0], 1.0
    return place


@kernel
def value_at(
    values: NDArray[Any],
    offset: int,
    axes: Array,
    rho_m: float,
    psi_rad: float,
    beta_rad: float,
    own: tuple[int, float],
    other: tuple[int, float],
) -> float:
    """Interpolated value; angles in any turn; bearings to port are mirrored."""
    if rho_m < axes[0]:
        return rho_m
    beta_rad -= TWO_PI * math.floor(beta_rad / TWO_PI + 0.5)
    if beta_rad < 0.0:
        beta_rad = -beta_rad
        psi_rad = -psi_rad
    n_psi, n_beta = int(axes[N_PSI]), int(axes[N_BETA])
    turns = psi_rad / TWO_PI
    psi = snapped(even_place((turns - math.floor(turns)) * n_psi, n_psi))
    beta = snapped(even_place(beta_rad / math.pi * (n_beta - 1), n_beta - 1))
    return blend(values, offset, axes, rho_place(axes, rho_m), psi, beta, own, other)


@kernel
def nearest(x0: float, y0: float, x1: float, y1: float) -> float:
    """Squared distance of the segment from (x0, y0) to (x1, y1) to the origin."""
    dx, dy = x1 - x0, y1 - y0
    length = dx * dx + dy * dy
    t = 0.0
    if length > 0.0:
        t = min(max(-(x0 * dx + y0 * dy) / length, 0.0), 1.0)
    x, y = x0 + t * dx, y0 + t * dy
    return x * x + y * y


@kernel
def closest(x: float, y: float, sin: float, cos: float, own: Array, other: Array) -> float:
    """Closest distance within a step; sin and cos of the relative heading; trails of `moves`, both (sub_steps, 2)."""
    best = x * x + y * y
    x0, y0 = x, y
    for k in range(own.shape[0]):
        x1 = x + other[k, 0] * cos + other[k, 1] * sin - own[k, 0]
        y1 = y - other[k, 0] * sin + other[k, 1] * cos - own[k, 1]
        best = min(best, nearest(x0, y0, x1, y1))
        x0, y0 = x1, y1
    return math.sqrt(best)


@kernel
def outcome(
    values: NDArray[Any],
    axes: Array,
    x: float,
    y: float,
    psi: float,
    sin: float,
    cos: float,
    reach_m: float,
    own_place: Array,
    own_turn: float,
    own_speed: tuple[int, float],
    other_place: Array,
    other_turn: float,
    other_speed: tuple[int, float],
) -> float:
    """Value after one step of one pair of moves: the smaller of what came in between and what is to come."""
    last = own_place.shape[0] - 1
    x1 = x + other_place[last, 0] * cos + other_place[last, 1] * sin - own_place[last, 0]
    y1 = y - other_place[last, 0] * sin + other_place[last, 1] * cos - own_place[last, 1]
    rho = math.sqrt(x1 * x1 + y1 * y1)
    later = value_at(
        values, 0, axes, rho, psi + other_turn - own_turn, math.atan2(x1, y1) - own_turn, own_speed, other_speed
    )
    if 0.5 * (math.sqrt(x * x + y * y) + rho - reach_m) < later:
        later = min(later, closest(x, y, sin, cos, own_place, other_place))
    return later


@kernel
def cell_value(
    values: NDArray[Any],
    axes: Array,
    x: float,
    y: float,
    psi: float,
    reach_m: float,
    own_place: Array,
    own_turn: Array,
    own_speed: Array,
    other_place: Array,
    other_turn: Array,
    other_speed: Array,
    cooperative: bool,
    old: float,
    hint: int,
) -> tuple[float, int]:
    """Best the own boat can get from here, no higher than ``old``, and the rudders (own * 8 + other) of it.

    Moves are rows of `moves.Moves` for one speed; ``own_speed`` holds (rudder, 2): speed cell and place in it.
    The own rudder of the hint is tried first, each answer of the other that hurt last is tried first.
    """
    sin, cos = math.sin(psi), math.cos(psi)
    n_own, n_other = own_turn.shape[0], other_turn.shape[0]
    best, choice = -1.0, hint
    first, worst = hint // 8, hint % 8
    for step in range(n_own):
        r = (first + step) % n_own
        low = 1e9
        if cooperative:
            low = -1.0
        answer, start = worst, worst
        for turn in range(n_other):
            s = (start + turn) % n_other
            value = outcome(
                values,
                axes,
                x,
                y,
                psi,
                sin,
                cos,
                reach_m,
                own_place[r],
                own_turn[r],
                (int(own_speed[r, 0]), own_speed[r, 1]),
                other_place[s],
                other_turn[s],
                (int(other_speed[s, 0]), other_speed[s, 1]),
            )
            if cooperative:
                if value > low:
                    low, answer = value, s
                if low >= old:
                    break
            else:
                if value < low:
                    low, answer = value, s
                if low <= best:
                    break
        worst = answer
        if low > best:
            best, choice = low, r * 8 + answer
        if best >= old:
            return old, choice
    return best, choice


@kernel
def sweep(
    values: NDArray[Any],
    out: NDArray[Any],
    hints: NDArray[np.uint8],
    active: BoolArray,
    changed: BoolArray,
    axes: Array,
    own_place: Array,
    own_turn: Array,
    own_speed: Array,
    other_place: Array,
    other_turn: Array,
    other_speed: Array,
    cooperative: bool,
    reach_m: float,
    tolerance_m: float,
    row: int,
) -> float:
    """Value iteration of one range: reads ``values``, lowers ``out``.

    Args:
        values: flat values over the grid, m.
        out: a copy of them, lowered in place.
        hints: best rudders of each cell, kept from one iteration to the next.
        active: places (range, relative heading, bearing) that may change; others are skipped.
        changed: set to True for the places that did change.
        axes: description of the grid.
        own_place: own `Moves.place_m`.
        own_turn: own `Moves.turn_rad`.
        own_speed: speed cell and place in it after each own move, shape ``(speeds, rudders, 2)``.
        other_place: the same of the other boat.
        other_turn: the same of the other boat.
        other_speed: the same of the other boat.
        cooperative: whether the other boat helps.
        reach_m: how far the two boats together can move in one step, m.
        tolerance_m: smaller changes are left out, m.
        row: range index.

    Returns:
        The largest change, m.
    """
    n_psi, n_beta = int(axes[N_PSI]), int(axes[N_BETA])
    n_own, n_other = int(axes[N_OWN]), int(axes[N_OTHER])
    largest = 0.0
    rho = rho_node(axes, row)
    for j in range(n_psi):
        psi = j * TWO_PI / n_psi
        for k in range(n_beta):
            if not active[row, j, k]:
                continue
            beta = k * math.pi / (n_beta - 1)
            x, y = rho * math.sin(beta), rho * math.cos(beta)
            at = ((row * n_psi + j) * n_beta + k) * n_own * n_other
            for a in range(n_own):
                for b in range(n_other):
                    old = values[at]
                    new, hints[at] = cell_value(
                        values,
                        axes,
                        x,
                        y,
                        psi,
                        reach_m,
                        own_place[a],
                        own_turn[a],
                        own_speed[a],
                        other_place[b],
                        other_turn[b],
                        other_speed[b],
                        cooperative,
                        old,
                        hints[at],
                    )
                    if new < old - tolerance_m:
                        out[at] = new
                        changed[row, j, k] = True
                        largest = max(largest, old - new)
                    at += 1
    return largest
