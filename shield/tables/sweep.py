"""Compiled value iteration of one range of a grid, and the places that can change next."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import Array, BoolArray, kernel
from .grid import N_BETA, N_OTHER, N_OWN, N_PSI, blend, even_place, rho_node, rho_place

TWO_PI = 2.0 * math.pi
SNAP = 1e-7
"""Places this near to a node (share of a cell) are moved onto it, so that turns that fit the grid cause no blur."""


class Ways(NamedTuple):
    """Effect of one table step on a boat: `moves.Moves`, with speeds as places on the grid."""

    place_m: Array  # `Moves.place_m`
    turn_rad: Array  # `Moves.turn_rad`
    speed: Array  # speed cell and place in it after each move, shape ``(speeds, rudders, 2)``


class Pursuit(NamedTuple):
    """A game of two boats on a grid."""

    axes: Array  # description of the grid
    own: Ways  # moves of the own boat
    other: Ways  # moves of the other boat
    cooperative: bool  # the other boat helps
    reach_m: float  # how far both boats together can move in one step, m


class Move(NamedTuple):
    """One move of a boat: its trail (sub_steps, 2), m, its turn, rad, and the speed cell and place in it afterwards."""

    trail_m: Array
    turn_rad: float
    speed: tuple[int, float]


@kernel
def move_of(ways: Ways, speed: int, rudder: int) -> Move:
    """Return the move from a speed node with a rudder."""
    after = ways.speed[speed, rudder]
    return Move(ways.place_m[speed, rudder], ways.turn_rad[speed, rudder], (int(after[0]), after[1]))


@kernel
def snapped(place: tuple[int, float]) -> tuple[int, float]:
    """Return the place, moved onto a node if within rounding of it."""
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
    """Return the interpolated value; angles may be of any turn; bearings to port are mirrored."""
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
    """Return the squared distance of the segment from (x0, y0) to (x1, y1) to the origin."""
    dx, dy = x1 - x0, y1 - y0
    length = dx * dx + dy * dy
    t = 0.0
    if length > 0.0:
        t = min(max(-(x0 * dx + y0 * dy) / length, 0.0), 1.0)
    x, y = x0 + t * dx, y0 + t * dy
    return x * x + y * y


@kernel
def closest(x: float, y: float, sin: float, cos: float, own: Array, other: Array) -> float:
    """Return the closest distance within a step, for the relative heading and trails of `moves`, (sub_steps, 2)."""
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
    values: NDArray[Any], game: Pursuit, x: float, y: float, psi: float, sin: float, cos: float, own: Move, other: Move
) -> float:
    """Return the value after one step of a pair of moves: the closest distance in it or the later value, if smaller."""
    own_place, other_place = own.trail_m, other.trail_m
    last = own_place.shape[0] - 1
    x1 = x + other_place[last, 0] * cos + other_place[last, 1] * sin - own_place[last, 0]
    y1 = y - other_place[last, 0] * sin + other_place[last, 1] * cos - own_place[last, 1]
    rho = math.sqrt(x1 * x1 + y1 * y1)
    heading, bearing = psi + other.turn_rad - own.turn_rad, math.atan2(x1, y1) - own.turn_rad
    later = value_at(values, 0, game.axes, rho, heading, bearing, own.speed, other.speed)
    if 0.5 * (math.sqrt(x * x + y * y) + rho - game.reach_m) < later:
        later = min(later, closest(x, y, sin, cos, own_place, other_place))
    return later


@kernel
def cell_value(
    values: NDArray[Any], game: Pursuit, x: float, y: float, psi: float, a: int, b: int, old: float, hint: int
) -> tuple[float, int]:
    """Return the best value the own boat can get, at most ``old``, and its rudders (own * 8 + other).

    For speed the own rudder of the hint is tried first, and first of the other's answers the one that was worst last.
    """
    sin, cos = math.sin(psi), math.cos(psi)
    n_own, n_other, cooperative = game.own.turn_rad.shape[1], game.other.turn_rad.shape[1], game.cooperative
    best, choice = -1.0, hint
    first, worst = hint // 8, hint % 8
    for step in range(n_own):
        r = (first + step) % n_own
        own = move_of(game.own, a, r)
        low = 1e9
        if cooperative:
            low = -1.0
        answer, start = worst, worst
        for turn in range(n_other):
            s = (start + turn) % n_other
            value = outcome(values, game, x, y, psi, sin, cos, own, move_of(game.other, b, s))
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
    game: Pursuit,
    tolerance_m: float,
    row: int,
) -> float:
    """Do the value iteration of one range and return the largest change, m.

    It reads ``values`` and lowers ``out``, a copy of them. Places that are not ``active`` are skipped. Places that
    change are set in ``changed``. Changes up to the tolerance are ignored. ``hints`` are the best rudders of each cell,
    carried over from one iteration to the next.
    """
    axes = game.axes
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
                    new, hints[at] = cell_value(values, game, x, y, psi, a, b, old, hints[at])
                    if new < old - tolerance_m:
                        out[at] = new
                        changed[row, j, k] = True
                        largest = max(largest, old - new)
                    at += 1
    return largest


@kernel
def widen(changed: BoolArray, axes: Array, reach_m: float, own_turn_rad: float, psi_turn_rad: float) -> BoolArray:
    """Return places (range, relative heading, bearing) from which one step leads to a changed one or its mirror image.

    In a step the boats together move ``reach_m``; the own boat turns by ``own_turn_rad``, the relative heading by
    ``psi_turn_rad``.
    """
    n_rho, n_psi, n_beta = changed.shape
    near = _over_headings(_over_ranges(changed, axes, reach_m), psi_turn_rad)
    active = np.zeros((n_rho, n_psi, n_beta), np.bool_)
    for i in range(n_rho):
        reach_beta = own_turn_rad + math.asin(min(reach_m / rho_node(axes, i), 1.0))
        if rho_node(axes, i) <= reach_m:
            reach_beta = math.pi
        width = min(math.ceil(reach_beta / math.pi * (n_beta - 1) + 1e-6) + 1, n_beta)
        for j in range(n_psi):
            for k in range(n_beta):
                if near[i, j, k]:
                    for m in range(k - width, k + width + 1):
                        _mark(active, i, j, m)
    return active


@kernel
def _mark(active: BoolArray, i: int, j: int, k: int) -> None:
    """Mark a place; bearings beyond dead ahead or dead astern are those of the mirror image."""
    n_psi, last = active.shape[1], active.shape[2] - 1
    if 0 <= k <= last:
        active[i, j, k] = True
        if k == 0 or k == last:
            active[i, (-j) % n_psi, k] = True
    else:
        active[i, (-j) % n_psi, min(max(-k if k < 0 else 2 * last - k, 0), last)] = True


@kernel
def _over_ranges(changed: BoolArray, axes: Array, reach_m: float) -> BoolArray:
    n_rho, n_psi, n_beta = changed.shape
    near = np.zeros((n_rho, n_psi, n_beta), np.bool_)
    low = 0
    for i in range(n_rho):
        rho = rho_node(axes, i)
        while low < i and rho_node(axes, low + 1) < rho - reach_m:
            low += 1
        high = i
        while high < n_rho - 1 and rho_node(axes, high) < rho + reach_m:
            high += 1
        for m in range(low, high + 1):
            for j in range(n_psi):
                for k in range(n_beta):
                    if changed[m, j, k]:
                        near[i, j, k] = True
    return near


@kernel
def _over_headings(changed: BoolArray, psi_turn_rad: float) -> BoolArray:
    n_rho, n_psi, n_beta = changed.shape
    near = np.zeros((n_rho, n_psi, n_beta), np.bool_)
    width = min(math.ceil(psi_turn_rad / (2.0 * math.pi) * n_psi - 1e-6), n_psi // 2)
    for i in range(n_rho):
        for j in range(n_psi):
            for k in range(n_beta):
                if changed[i, j, k]:
                    for d in range(-width, width + 1):
                        near[i, (j + d) % n_psi, k] = True
    return near
