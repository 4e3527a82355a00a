"""Rows of a game's program: one per pair of boats, and the limits of each boat's inputs.

Every boat of ours has two inputs z: its velocity (east, north, m/s) for the velocity filter; for the others its
acceleration and turn rate as shares of its braking and of its largest turn rate now. Opponents keep their present
velocity; team-mates share a row, which both of them answer.
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
def wanted_velocity(setup: Setup, state: Array, command: Array, i: int) -> tuple[float, float]:
    """Velocity that the single integrator takes a command for, m/s east and north."""
    top = setup.limits[i, 0]
    speed = max(min(command[0], top), 0.0)
    heading = math.radians(state[L.HEADING] + command[1])
    return speed * math.sin(heading), speed * math.cos(heading)


@kernel
def reach(setup: Setup, state: Array, i: int) -> tuple[float, float]:
    """Least and greatest acceleration in this step, as shares of braking: a boat neither reverses nor tops its top."""
    step = setup.limits[i, 2] * setup.dt_s
    low, high = max(state[L.SPEED], 0.0) / step, max(setup.limits[i, 0] - state[L.SPEED], 0.0) / step
    return -min(1.0, low), min(setup.limits[i, 1] / setup.limits[i, 2], high)


@kernel
def wanted_inputs(setup: Setup, state: Array, command: Array, i: int) -> tuple[float, float, float, float]:
    """Inputs z that a command amounts to (2) and the units of z (2)."""
    if setup.kind == DISTANCE:
        east, north = wanted_velocity(setup, state, command, i)
        return east, north, 1.0, 1.0
    limits = setup.limits[i]
    gain, turn, most = inputs_of_command(setup.params[i], limits, state, command[0], command[1], setup.dt_s)
    unit = most if most > 0.0 else 1.0
    low, high = reach(setup, state, i)
    return clamp(gain / limits[2], low, high), turn / unit, limits[2], unit


@kernel
def input_rows(
    setup: Setup, first: Array, second: Array, unit_i: Array, unit_j: Array, gains: Array
) -> tuple[float, float, float, float, float]:
    """Row of a second-order barrier: dh/dp v + dh/dv (u_j' - u_i') >= -alpha h, u' = a e + v w n per boat."""
    a, b = math.radians(first[L.HEADING]), math.radians(second[L.HEADING])
    v, w = first[L.SPEED], second[L.SPEED]
    ea, na, eb, nb = math.sin(a), math.cos(a), math.sin(b), math.cos(b)
    vx, vy = w * eb - v * ea, w * nb - v * na
    px, py = second[L.X] - first[L.X], second[L.Y] - first[L.Y]
    h, gpx, gpy, gvx, gvy = barrier(setup.kind, gains, px, py, vx, vy, setup.radius_m)
    return (
        -(gvx * ea + gvy * na) * unit_i[0],
        -(gvx * na - gvy * ea) * v * unit_i[1],
        (gvx * eb + gvy * nb) * unit_j[0],
        (gvx * nb - gvy * eb) * w * unit_j[1],
        -gains[1] * h - gpx * vx - gpy * vy,
    )


@kernel
def velocity_row(
    setup: Setup, first: Array, second: Array, both: bool, gains: Array
) -> tuple[float, float, float, float, float]:
    """Row of the single integrator: 2 p (u_j - u_i) >= -alpha (|p|^2 - R^2); u_j is given unless both are ours."""
    px, py = second[L.X] - first[L.X], second[L.Y] - first[L.Y]
    need = -gains[1] * (px * px + py * py - setup.radius_m * setup.radius_m)
    if not both:
        course = math.radians(second[L.HEADING])
        need -= 2.0 * second[L.SPEED] * (px * math.sin(course) + py * math.cos(course))
    return -2.0 * px, -2.0 * py, 2.0 * px, 2.0 * py, need


@kernel
def pair_row(
    setup: Setup, state: Array, unit: Array, i: int, j: int, both: bool, gains: Array
) -> tuple[float, float, float, float, float]:
    """Row of the pair: coefficients of boat i (2), of boat j (2; 0 unless both are ours), right-hand side; unit length.

    A pair on which no input has any effect gives zero coefficients and its right-hand side as it is.
    """
    if setup.kind == DISTANCE:
        a, b, c, e, d = velocity_row(setup, state[i], state[j], both, gains)
    else:
        a, b, c, e, d = input_rows(setup, state[i], state[j], unit[i], unit[j], gains)
    if not both:
        c, e = 0.0, 0.0
    length = math.sqrt(a * a + b * b + c * c + e * e)
    if length <= 1e-9:
        return 0.0, 0.0, 0.0, 0.0, d
    return a / length, b / length, c / length, e / length, d / length


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
            C[at, column], C[at, column + 1], d[at] = -math.sin(angle), -math.cos(angle), -fastest
            at += 1
        return at
    low, high = reach(setup, state, i)
    C[at, column], d[at] = 1.0, low
    C[at + 1, column], d[at + 1] = -1.0, -high
    C[at + 2, column + 1], d[at + 2] = 1.0, -1.0
    C[at + 3, column + 1], d[at + 3] = -1.0, -1.0
    return at + 4
