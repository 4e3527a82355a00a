"""The distance made exponential, for boats that accelerate: its own row is the barrier.

    h = d/dt (|p|^2 - R^2) + a1 (|p|^2 - R^2),   row dh/dt >= -alpha h

Nguyen, Sreenath 2016 (ACC); with linear class-K functions also the barrier of Xiao, Belta 2021 (TAC). alpha is a2.
"""

from itertools import product

from steerclear.shield.jit import Array

from .barrier import Barrier, Jet, dot

A1_A2_PER_S = product((0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0), repeat=2)


def jet(p: Array, v: Array, radius_m: float, a1: Array) -> Jet:
    """h, m^2/s, and its derivatives; a1 in 1/s."""
    return 2.0 * dot(p, v) + a1 * (dot(p, p) - radius_m * radius_m), 2.0 * (v + a1 * p), 2.0 * p


BARRIER = Barrier(
    jet,
    tuned={"heron": (1.0, 0.1), "surveyor": (0.5, 0.05)},
    tried=((1.0, 1.0), *((a2, a1) for a1, a2 in A1_A2_PER_S)),
)
