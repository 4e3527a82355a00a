"""Rows of a game's program: one per pair of boats, and the limits of each boat's inputs.

Every boat of ours has two inputs z: its velocity (east, north, m/s) for the velocity filter; for the others its
acceleration and turn rate as shares of its braking and of its largest turn rate now. Opponents keep their present
velocity; team-mates share a row, which both of them answer. A row reads, with alpha h the class-K function,

    dh/dp v + dh/dv (u_j' - u_i') >= -alpha h,   u' = a e + v w n per boat; of velocities dh/dp (u_j - u_i) >= -alpha h.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import clamp

from ..jit import kernel
from .barriers import DISTANCE, barrier
from .inputs import inputs_of_command

FACETS = 16
"""Sides of the polygon within the disc of speeds; one corner lies in the wanted direction."""


class Setup(NamedTuple):
    """Constants of a filter: kind, gains (n, N_GAIN), radius m, dt s, platform rows (n, N_PARAM), limits (n, 3)."""

    kind: int
    gains: Array
    radius_m: float
    dt_s: float
    params: Array
    limits: Array


@kernel
def reach(setup: Setup, state: Array, i: int) -> tuple[float, float]:
    """Least and greatest acceleration in this step, as shares of braking: a boat neither reverses nor tops its top."""
    step = setup.limits[i, 2] * setup.dt_s
    low, high = max(state[L.SPEED], 0.0) / step, max(setup.limits[i, 0] - state[L.SPEED], 0.0) / step
    return -min(1.0, low), min(setup.limits[i, 1] / setup.limits[i, 2], high)


@kernel
def wanted_inputs(setup: Setup, state: Array, command: Array, i: int) -> tuple[float, float, float, float]:
    """Inputs z that a command amounts to (2) and the units of z (2)."""
    limits = setup.limits[i]
    if setup.kind == DISTANCE:
        speed, heading = max(min(command[0], limits[0]), 0.0), math.radians(state[L.HEADING] + command[1])
        return speed * math.sin(heading), speed * math.cos(heading), 1.0, 1.0
    gain, turn, most = inputs_of_command(setup.params[i], limits, state, command[0], command[1], setup.dt_s)
    unit = most if most > 0.0 else 1.0
    low, high = reach(setup, state, i)
    return clamp(gain / limits[2], low, high), turn / unit, limits[2], unit


@kernel
def pair_row(
    setup: Setup, state: Array, unit: Array, i: int, j: int, both: bool, gains: Array
) -> tuple[float, float, float, float, float]:
    """Row of the pair: coefficients of boat i (2), of boat j (2; 0 unless both are ours), right-hand side; unit length.

    A pair on which no input has any effect gives zero coefficients and its right-hand side as it is.
    """
    first, second = state[i], state[j]
    one, two, v, w = math.radians(first[L.HEADING]), math.radians(second[L.HEADING]), first[L.SPEED], second[L.SPEED]
    ei, ni, ej, nj = math.sin(one), math.cos(one), math.sin(two), math.cos(two)
    px, py, vx, vy = second[L.X] - first[L.X], second[L.Y] - first[L.Y], w * ej - v * ei, w * nj - v * ni
    h, gpx, gpy, gvx, gvy = barrier(setup.kind, gains, px, py, vx, vy, setup.radius_m)
    if setup.kind == DISTANCE:
        a, b, c, e = -gpx, -gpy, gpx, gpy
        need = -gains[1] * h - (0.0 if both else w * (gpx * ej + gpy * nj))
    else:
        a, b = -(gvx * ei + gvy * ni) * unit[i, 0], -(gvx * ni - gvy * ei) * v * unit[i, 1]
        c, e = (gvx * ej + gvy * nj) * unit[j, 0], (gvx * nj - gvy * ej) * w * unit[j, 1]
        need = -gains[1] * h - gpx * vx - gpy * vy
    if not both:
        c, e = 0.0, 0.0
    length = math.sqrt(a * a + b * b + c * c + e * e)
    if length <= 1e-9:
        return 0.0, 0.0, 0.0, 0.0, need
    return a / length, b / length, c / length, e / length, need / length


@kernel
def least(setup: Setup, state: Array, i: int, a: float, b: float) -> float:
    """Least value of a z_1 + b z_2 over the inputs boat i has."""
    if setup.kind == DISTANCE:
        return -setup.limits[i, 0] * math.sqrt(a * a + b * b)
    low, high = reach(setup, state, i)
    return min(low * a, high * a) - abs(b)


@kernel
def limit_rows(setup: Setup, state: Array, i: int, column: int, C: Array, d: Array, at: int, heading_deg: float) -> int:
    """Write the limits of boat i's inputs as rows from ``at`` on; returns the next free row."""
    if setup.kind == DISTANCE:
        fastest = setup.limits[i, 0] * math.cos(math.pi / FACETS)
        for k in range(FACETS):
            angle = math.radians(heading_deg) + (2 * k + 1) * math.pi / FACETS
            C[at + k, column], C[at + k, column + 1], d[at + k] = -math.sin(angle), -math.cos(angle), -fastest
        return at + FACETS
    low, high = reach(setup, state, i)
    C[at, column], C[at + 1, column], C[at + 2, column + 1], C[at + 3, column + 1] = 1.0, -1.0, 1.0, -1.0
    d[at], d[at + 1], d[at + 2], d[at + 3] = low, -high, -1.0, -1.0
    return at + 4
