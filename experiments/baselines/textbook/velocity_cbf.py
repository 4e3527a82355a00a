"""The distance, of boats whose velocity u is their input.

    h = |p|^2 - R^2,   row <dh/dp, u_j - u_i> >= -alpha h

Ames et al. 2019 (ECC); pairwise as Wang, Ames, Egerstedt 2017 (T-RO).
"""

from itertools import product

from steerclear.shield.jit import Array

from .barrier import RATES_PER_S, Barrier, Jet, dot


def jet(p: Array, v: Array, radius_m: float) -> Jet:
    """h, m^2, and its derivatives."""
    return dot(p, p) - radius_m * radius_m, 2.0 * p, 2.0 * p


BARRIER = Barrier(
    jet, tuned={"heron": (0.025,), "surveyor": (0.05,)}, tried=((1.0,), *product(RATES_PER_S)), of_velocity=True
)
