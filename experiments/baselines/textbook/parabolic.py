"""Dynamic parabola: closing in along the line of sight is bounded by the distance and by the speed across it.

    h = v_x + k_l s/|v| v_y^2 + k_m s,   row dh/dt >= -alpha h,   (v_x, v_y) = v along and across p

Park et al. 2025, arXiv 2510.01402. The formula is from what its authors published with the paper, the README and the
class ``KinematicBicycle2D_DPCBF`` of their library safe_control; equation numbers of the paper are therefore not cited.
k_l (1/m) and k_m (1/s) are gains times sqrt(w^2 - 1)/R, and R is widened by the factor w, s in that library.
"""

import math
from itertools import product

import numpy as np
from steerclear.shield.jit import Array

from .barrier import Barrier, Jet, dot, pace, tangent

WIDENED = 1.05
GRID = (0.05, 0.1, 0.25, 0.5, 1.0, 4.0), (0.1, 0.5, 2.0), (0.25, 0.5, 1.0, 2.0, 8.0, 16.0)


def jet(p: Array, v: Array, radius_m: float, lambda_share: Array, mu_share: Array) -> Jet:
    """h, m/s, and its derivatives; n across the line of sight e, dv_x/dp = v_y n/|p|, dv_y/dp = -v_x n/|p|."""
    unit = math.sqrt(WIDENED**2 - 1.0) / radius_m
    (s, k), speed, gap = tangent(p, radius_m), pace(v), np.sqrt(dot(p, p)) + 1e-12
    e = p / gap
    n = np.stack([-e[1], e[0]])
    v_x, v_y, k_m = dot(e, v), dot(n, v), mu_share * unit
    bend = lambda_share * unit * v_y / speed
    turn = (v_y - 2.0 * bend * s * v_x) / gap
    h_p = k * (bend * v_y + k_m) * p + turn * n
    h_v = e + 2.0 * bend * s * n - bend * v_y * s / (speed * speed) * v
    return v_x + bend * v_y * s + k_m * s, h_p, h_v


BARRIER = Barrier(
    jet,
    tuned={"heron": (0.05, 0.5, 8.0), "surveyor": (1.0, 0.5, 0.25)},
    tried=((1.0, 0.1, 0.5), *product(*GRID)),
    widened=WIDENED,
)
