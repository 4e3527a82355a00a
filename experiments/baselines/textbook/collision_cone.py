"""Collision cone: the relative velocity stays out of the cone of courses that pass within the radius.

    h = <p, v> + |v| s, which is <p, v> + |p| |v| cos(phi), phi half the angle of the cone;   row dh/dt >= -alpha h

Thontepu et al. 2022, arXiv 2209.11524.
"""

from itertools import product

from steerclear.shield.jit import Array

from .barrier import RATES_PER_S, Barrier, Jet, dot, pace, tangent


def jet(p: Array, v: Array, radius_m: float) -> Jet:
    """h, m^2/s, and its derivatives."""
    (s, k), speed = tangent(p, radius_m), pace(v)
    return dot(p, v) + speed * s, v + speed * k * p, p + s * v / speed


BARRIER = Barrier(jet, tuned={"heron": (3.0,), "surveyor": (5.0,)}, tried=((1.0,), *product(RATES_PER_S)))
