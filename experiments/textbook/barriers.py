r"""Barrier functions of a pair of boats, with their gradients.

Symbols: p = p_j - p_i (m) and v = v_j - v_i (m/s), east and north; R the radius to keep (m); s = sqrt(|p|^2 - R^2).
Every h is >= 0 where safe. Derivatives are in closed form; `tests` hold them against differences.

| name | h | source |
| --- | --- | --- |
| distance | \|p\|^2 - R^2 | Ames et al. 2019 (ECC); pairwise as Wang, Ames, Egerstedt 2017 (T-RO) |
| exponential | h' + a1 h of the distance | Nguyen, Sreenath 2016 (ACC); Xiao, Belta 2021 (TAC), linear class K |
| collision cone | <p, v> + \|v\| s, which is <p, v> + \|p\| \|v\| cos(phi) | Thontepu et al. 2022, arXiv 2209.11524 |
| parabolic | v_x + k_l s/\|v\| v_y^2 + k_m s, (v_x, v_y) = v along and across p | Park et al. 2025, arXiv 2510.01402 |

The parabolic formula is taken from what its authors published with the paper, the README and the class
``KinematicBicycle2D_DPCBF`` of their library safe_control; equation numbers of the paper are therefore not cited.
Where \|v\| or s vanish the formulas are singular: \|v\| is smoothed by `STILL_MPS`, and s^2 is cut from below at
`NEAREST_M2`, where its derivative is 0. The papers leave both to the implementation.
"""

from __future__ import annotations

import math

from steerclear.shield.jit import Array

from ..jit import kernel

DISTANCE, EXPONENTIAL, COLLISION_CONE, PARABOLIC = range(4)
N_GAIN = 4
"""Gains of a barrier: a1 (1/s) or unused, alpha (1/s), k_lambda (1/m), k_mu (1/s)."""
STILL_MPS = 1e-6
NEAREST_M2 = 1e-4

Jet = tuple[float, float, float, float, float]
"""h, dh/dp (2), dh/dv (2)."""


@kernel
def barrier(kind: int, gains: Array, px: float, py: float, vx: float, vy: float, radius_m: float) -> Jet:
    """The barrier of that kind: gains (`N_GAIN`,), p in m, v in m/s, radius to keep.

    The parabola is in the frame of the line of sight, which turns with p: d(v_x)/dp = v_y t/|p| and d(v_y)/dp =
    -v_x t/|p|, t the unit vector across p.
    """
    clear = px * px + py * py - radius_m * radius_m
    if kind == DISTANCE:
        return clear, 2.0 * px, 2.0 * py, 0.0, 0.0
    if kind == EXPONENTIAL:
        a1 = gains[0]
        return 2.0 * (px * vx + py * vy) + a1 * clear, 2.0 * (vx + a1 * px), 2.0 * (vy + a1 * py), 2.0 * px, 2.0 * py
    s, slope = math.sqrt(NEAREST_M2), 0.0  # ds/dp = slope p
    if clear > NEAREST_M2:
        s = math.sqrt(clear)
        slope = 1.0 / s
    pace = math.sqrt(vx * vx + vy * vy + STILL_MPS * STILL_MPS)
    if kind == COLLISION_CONE:
        grow = pace * slope
        h = px * vx + py * vy + pace * s
        return h, vx + grow * px, vy + grow * py, px + s * vx / pace, py + s * vy / pace
    gap = math.sqrt(px * px + py * py) + 1e-12
    ex, ey = px / gap, py / gap
    along, across = ex * vx + ey * vy, ex * vy - ey * vx
    bend = gains[2] * across / pace
    out = slope * (bend * across + gains[3])
    turn = (across - 2.0 * bend * s * along) / gap
    fade = bend * across * s / (pace * pace)
    return (
        along + bend * across * s + gains[3] * s,
        out * px - turn * ey,
        out * py + turn * ex,
        ex - 2.0 * bend * s * ey - fade * vx,
        ey + 2.0 * bend * s * ex - fade * vy,
    )
