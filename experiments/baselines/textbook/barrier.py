"""What a barrier of the literature is: a function h >= 0 of a pair of boats, its slope, its gains and its inputs.

Vectors are arrays of their two parts, east and north, of any further shape: p = p_j - p_i, m, and v = v_j - v_i, m/s.
R is the radius to keep, m, and s = sqrt(|p|^2 - R^2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from steerclear.shield.jit import Array

Gains = tuple[float, ...]
Jet = tuple[Array, Array, Array]
"""h, and its derivatives along p and along what the inputs act on: v, or p where they are velocities."""
NEAREST_M2, STILL_MPS = 1e-4, 1e-6
"""s^2 is cut from below there, with derivative 0, and |v| is smoothed by that: the papers leave both open."""
RATES_PER_S = (0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)


class Barrier(NamedTuple):
    """A barrier of the literature: its ``jet`` (p, v, R, *gains of its own) and its gains, alpha (1/s) the first.

    They are ``tuned`` by platform, the winners of `sweep` of those ``tried``, of which the first are every other
    platform's. Inputs are velocities, or those of `inputs`; the radius is ``widened`` by a factor.
    """

    jet: Callable[..., Jet]
    tuned: dict[str, Gains]
    tried: tuple[Gains, ...]
    of_velocity: bool = False
    widened: float = 1.0


def dot(a: Array, b: Array) -> Array:
    """Inner product."""
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def tangent(p: Array, radius_m: float) -> tuple[Array, Array]:
    """s, the length of the tangent from p to the circle of the radius, m, and k of its derivative k p."""
    square = dot(p, p) - radius_m * radius_m
    s = np.sqrt(np.maximum(square, NEAREST_M2))
    return s, np.where(square > NEAREST_M2, 1.0 / s, 0.0)


def pace(v: Array) -> Array:
    """|v|, smoothed, m/s."""
    return np.asarray(np.sqrt(dot(v, v) + STILL_MPS * STILL_MPS))
