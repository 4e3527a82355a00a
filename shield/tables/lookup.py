"""Compiled lookup of a value: the distance that two boats can keep, and its gradient."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import Array, IntArray, lean_kernel
from .grid import (
    CAP,
    N_AXES,
    N_BETA,
    N_OTHER,
    N_OWN,
    N_PSI,
    N_RHO,
    OTHER_TOP,
    OWN_TOP,
    RHO_FIRST,
    RHO_GROWTH,
    RHO_STEP,
    blend,
    even_place,
    rho_node,
    rho_place,
)

STEPS = 255
"""Values are stored as whole steps of cap / 255, rounded down."""

LEVELS_S = (3.0, 6.0, 9.0, 12.0, 20.0)
"""Times T for which a table stores V(x, T), besides the whole play; in between it is interpolated.

V(x, T) is the distance that can be kept from another boat that does its worst for T. V(x, 0) is the distance itself.
"""
WHOLE_S = 90.0
"""Time from which on the value of the whole play applies."""
N_LEVELS = len(LEVELS_S) + 1
"""Values stored for each place: at `LEVELS_S`, and for the whole play."""


class Tables(NamedTuple):
    """Several concatenated value tables, for compiled code."""

    data: NDArray[np.uint8]  # all values, uint8, in steps of cap / 255
    level: IntArray  # start of each table's levels, the last for the whole play, shape ``(n_tables, N_LEVELS)``
    axes: Array  # each table's grid, shape ``(n_tables, N_AXES)``
    full_m: Array  # range from which a level and all before it hold only the cap; shape as ``level``


class Gradient(NamedTuple):
    """A value, m, and its derivatives; positions in m, headings in rad clockwise, speeds in m/s.

    The derivatives with respect to the other's position are those of the own position with opposite signs.
    """

    value_m: float
    own_x: float
    own_y: float
    own_heading: float
    own_speed: float
    other_heading: float
    other_speed: float


def no_tables() -> Tables:
    """Return an empty set, for code that takes tables but has none."""
    return Tables(
        np.zeros(0, np.uint8), np.zeros((0, N_LEVELS), np.int64), np.zeros((0, N_AXES)), np.zeros((0, N_LEVELS))
    )


def pack(values_m: NDArray[Any], cap_m: float) -> NDArray[np.uint8]:
    """Return values in m as whole steps of cap / 255, rounded down."""
    steps = np.floor(values_m.astype(np.float64) * (STEPS / cap_m) + 1e-6)
    return np.clip(steps, 0, STEPS).astype(np.uint8)


@lean_kernel
def table_range_m(tables: Tables, table: int) -> float:
    """Return the largest range of a table, m; farther boats are looked up as if they were there."""
    axes = tables.axes[table]
    return rho_node(axes, int(axes[N_RHO]) - 1)


@lean_kernel
def _speed_places(axes: Array, own_mps: float, other_mps: float) -> tuple[tuple[int, float], tuple[int, float]]:
    n_own, n_other = int(axes[N_OWN]) - 1, int(axes[N_OTHER]) - 1
    return even_place(own_mps / axes[OWN_TOP] * n_own, n_own), even_place(
        other_mps / axes[OTHER_TOP] * n_other, n_other
    )


@lean_kernel
def _angle_places(
    axes: Array, bearing_rad: float, own_rad: float, other_rad: float
) -> tuple[tuple[int, float], tuple[int, float], float]:
    """Return places of relative heading and bearing, and the side: 1 starboard, -1 port (mirrored)."""
    half_turns = (bearing_rad - own_rad) / math.pi
    half_turns -= 2.0 * math.floor(0.5 * half_turns + 0.5)
    side = 1.0
    if half_turns < 0.0:
        side = -1.0
    turns = side * (other_rad - own_rad) / (2.0 * math.pi)
    n_psi, n_beta = int(axes[N_PSI]), int(axes[N_BETA]) - 1
    return even_place((turns - math.floor(turns)) * n_psi, n_psi), even_place(side * half_turns * n_beta, n_beta), side


@lean_kernel
def _level_of(tables: Tables, table: int, horizon_s: float) -> tuple[int, float]:
    """Return the level below a time T (-1: the distance itself) and the share of the way to the next one."""
    level = tables.level[table]
    if horizon_s >= WHOLE_S or level[0] == level[N_LEVELS - 1]:
        return N_LEVELS - 1, 0.0
    low, low_s = -1, 0.0
    for k in range(N_LEVELS - 1):
        if horizon_s < LEVELS_S[k]:
            return low, (horizon_s - low_s) / (LEVELS_S[k] - low_s)
        low, low_s = k, LEVELS_S[k]
    return low, (horizon_s - low_s) / (WHOLE_S - low_s)


@lean_kernel
def full_from_m(tables: Tables, table: int, horizon_s: float) -> float:
    """Return the range, m, from which on all values of a table for a time T equal its cap."""
    low, part = _level_of(tables, table, horizon_s)
    return tables.full_m[table, low + 1 if part > 0.0 else max(0, low)]


@lean_kernel
def table_value(
    tables: Tables,
    table: int,
    horizon_s: float,
    dx_m: float,
    dy_m: float,
    own_heading_rad: float,
    other_heading_rad: float,
    own_speed_mps: float,
    other_speed_mps: float,
) -> float:
    """Return the distance, m, that the own boat can keep from now on, at most the cap; NaN if an input is not finite.

    The other boat does its worst for ``horizon_s``; from `WHOLE_S` on this means the whole play. Between levels the
    value is interpolated. Positions are the other's minus the own, headings clockwise from north. Speeds are clamped to
    the table's.
    """
    if not math.isfinite(dx_m + dy_m + own_heading_rad + other_heading_rad + own_speed_mps + other_speed_mps):
        return math.nan
    axes = tables.axes[table]
    rho = math.sqrt(dx_m * dx_m + dy_m * dy_m)
    if rho < axes[RHO_FIRST]:
        return rho
    low, part = _level_of(tables, table, horizon_s)
    if rho >= full_from_m(tables, table, horizon_s):
        return axes[CAP]
    psi, beta, _ = _angle_places(axes, math.atan2(dx_m, dy_m), own_heading_rad, other_heading_rad)
    own, other = _speed_places(axes, own_speed_mps, other_speed_mps)
    value = 0.0
    for k in range(low, low + (2 if part > 0.0 else 1)):
        share = part if k > low else 1.0 - part
        if k < 0:
            value += share * min(rho, axes[CAP])
        else:
            steps = blend(tables.data, tables.level[table, k], axes, rho_place(axes, rho), psi, beta, own, other)
            value += share * (steps * axes[CAP] / STEPS)
    return value


@lean_kernel
def table_gradient(
    tables: Tables,
    table: int,
    horizon_s: float,
    dx_m: float,
    dy_m: float,
    own_heading_rad: float,
    other_heading_rad: float,
    own_speed_mps: float,
    other_speed_mps: float,
) -> Gradient:
    """Return value and derivatives, exact for the interpolated value; arguments as for `table_value`.

    The derivative with respect to a clamped input is 0. On a cell's edge the derivative is that of one side.
    """
    total = dx_m + dy_m + own_heading_rad + other_heading_rad + own_speed_mps + other_speed_mps
    if not math.isfinite(total):
        return Gradient(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)
    rho = math.sqrt(dx_m * dx_m + dy_m * dy_m)
    if rho < tables.axes[table, RHO_FIRST]:
        return _slope_of_distance(math.inf, dx_m, dy_m, rho)
    low, part = _level_of(tables, table, horizon_s)
    value = x = y = heading = speed = other_heading = other_speed = 0.0
    for k in range(low, low + (2 if part > 0.0 else 1)):
        share = part if k > low else 1.0 - part
        if k < 0:
            slope = _slope_of_distance(tables.axes[table, CAP], dx_m, dy_m, rho)
        else:
            slope = _slope_of_level(
                tables,
                table,
                tables.level[table, k],
                dx_m,
                dy_m,
                own_heading_rad,
                other_heading_rad,
                own_speed_mps,
                other_speed_mps,
            )
        value += share * slope.value_m
        x += share * slope.own_x
        y += share * slope.own_y
        heading += share * slope.own_heading
        speed += share * slope.own_speed
        other_heading += share * slope.other_heading
        other_speed += share * slope.other_speed
    return Gradient(value, x, y, heading, speed, other_heading, other_speed)


@lean_kernel
def _slope_of_distance(cap_m: float, dx_m: float, dy_m: float, rho: float) -> Gradient:
    """Return value and derivatives of min(distance, cap)."""
    if rho > cap_m:
        return Gradient(cap_m, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    scale = 1.0 / max(rho, 1e-9)
    return Gradient(rho, -dx_m * scale, -dy_m * scale, 0.0, 0.0, 0.0, 0.0)


@lean_kernel
def _slope_of_level(
    tables: Tables,
    table: int,
    at: int,
    dx_m: float,
    dy_m: float,
    own_heading_rad: float,
    other_heading_rad: float,
    own_speed_mps: float,
    other_speed_mps: float,
) -> Gradient:
    """Return the gradient for the level that begins at ``at`` in the data, beyond the first range."""
    axes = tables.axes[table]
    rho = math.sqrt(dx_m * dx_m + dy_m * dy_m)
    psi, beta, side = _angle_places(axes, math.atan2(dx_m, dy_m), own_heading_rad, other_heading_rad)
    own, other = _speed_places(axes, own_speed_mps, other_speed_mps)
    range_place = rho_place(axes, rho)
    n_psi, n_beta = int(axes[N_PSI]), int(axes[N_BETA])
    n_own, n_other = int(axes[N_OWN]), int(axes[N_OTHER])
    value = d_rho = d_psi = d_beta = d_own = d_other = 0.0
    for di in range(2):
        w_rho = range_place[1] if di == 1 else 1.0 - range_place[1]
        for dj in range(2):
            w_psi = psi[1] if dj == 1 else 1.0 - psi[1]
            j = (psi[0] + dj) % n_psi
            for dk in range(2):
                w_beta = beta[1] if dk == 1 else 1.0 - beta[1]
                node = ((range_place[0] + di) * n_psi + j) * n_beta + beta[0] + dk
                corner = at + (node * n_own + own[0]) * n_other + other[0]
                low, high = float(tables.data[corner]), float(tables.data[corner + n_other])
                low_step = float(tables.data[corner + 1]) - low
                high_step = float(tables.data[corner + n_other + 1]) - high
                low += other[1] * low_step
                high += other[1] * high_step
                here = low + own[1] * (high - low)
                weight = w_rho * w_psi * w_beta
                value += weight * here
                d_own += weight * (high - low)
                d_other += weight * (low_step + own[1] * (high_step - low_step))
                d_rho += (2 * di - 1) * w_psi * w_beta * here
                d_psi += (2 * dj - 1) * w_rho * w_beta * here
                d_beta += (2 * dk - 1) * w_rho * w_psi * here
    unit = axes[CAP] / STEPS
    d_rho *= unit / (axes[RHO_STEP] + axes[RHO_GROWTH] * range_place[0])
    if rho > rho_node(axes, int(axes[N_RHO]) - 1):
        d_rho = 0.0
    d_psi *= unit * side * n_psi / (2.0 * math.pi)
    d_beta *= unit * side * (n_beta - 1) / math.pi
    d_own *= unit * _clamped(own_speed_mps, axes[OWN_TOP]) * (n_own - 1) / axes[OWN_TOP]
    d_other *= unit * _clamped(other_speed_mps, axes[OTHER_TOP]) * (n_other - 1) / axes[OTHER_TOP]
    own_x = -d_rho * dx_m / rho - d_beta * dy_m / (rho * rho)
    own_y = -d_rho * dy_m / rho + d_beta * dx_m / (rho * rho)
    return Gradient(value * unit, own_x, own_y, -d_beta - d_psi, d_own, d_psi, d_other)


@lean_kernel
def _clamped(speed_mps: float, top_mps: float) -> float:
    """Return 1 within the speed axis, 0 outside it."""
    if speed_mps < 0.0 or speed_mps > top_mps:
        return 0.0
    return 1.0
