r"""Barrier functions of a pair of boats, with their gradients: one formula, one compiled function each.

Symbols: p = p_j - p_i (m) and v = v_j - v_i (m/s), east and north; R the radius to keep (m); s = sqrt(|p|^2 - R^2).
Every h is >= 0 where safe. Derivatives are those of the formula in closed form; `tests` hold them against differences.

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

DISTANCE = 0
EXPONENTIAL = 1
COLLISION_CONE = 2
PARABOLIC = 3

STILL_MPS = 1e-6
NEAREST_M2 = 1e-4

N_GAIN = 4
"""Gains of a barrier: a1 or unused, alpha, k_lambda, k_mu."""

Jet = tuple[float, float, float, float, float]
"""h, dh/dp (2), dh/dv (2)."""


@kernel
def exponential(px: float, py: float, vx: float, vy: float, radius_m: float, a1_per_s: float) -> Jet:
    """First-order residue of the distance barrier; holding its own CBF row is the second-order condition."""
    h = 2.0 * (px * vx + py * vy) + a1_per_s * (px * px + py * py - radius_m * radius_m)
    return h, 2.0 * (vx + a1_per_s * px), 2.0 * (vy + a1_per_s * py), 2.0 * px, 2.0 * py


@kernel
def _clear(px: float, py: float, radius_m: float) -> tuple[float, float]:
    """Give s and the factor of p in its derivative: ds/dp = p/s, or 0 where s is cut."""
    square = px * px + py * py - radius_m * radius_m
    if square <= NEAREST_M2:
        return math.sqrt(NEAREST_M2), 0.0
    s = math.sqrt(square)
    return s, 1.0 / s


@kernel
def collision_cone(px: float, py: float, vx: float, vy: float, radius_m: float) -> Jet:
    """The relative velocity stays out of the cone of directions that lead into the disc."""
    s, slope = _clear(px, py, radius_m)
    pace = math.sqrt(vx * vx + vy * vy + STILL_MPS * STILL_MPS)
    h = px * vx + py * vy + pace * s
    grow = pace * slope
    return h, vx + grow * px, vy + grow * py, px + s * vx / pace, py + s * vy / pace


@kernel
def parabolic(px: float, py: float, vx: float, vy: float, radius_m: float, k_lambda: float, k_mu: float) -> Jet:
    """The relative velocity, in the frame of the line of sight, stays out of a parabola that shrinks with clearance.

    The frame turns with p: d(v_x)/dp = v_y t/|p| and d(v_y)/dp = -v_x t/|p|, t the unit vector across p.
    """
    s, slope = _clear(px, py, radius_m)
    pace = math.sqrt(vx * vx + vy * vy + STILL_MPS * STILL_MPS)
    gap = math.sqrt(px * px + py * py) + 1e-12
    ex, ey = px / gap, py / gap
    along, across = ex * vx + ey * vy, ex * vy - ey * vx
    bend = k_lambda * across / pace
    h = along + bend * across * s + k_mu * s
    out = slope * (bend * across + k_mu)
    turn = (across - 2.0 * bend * s * along) / gap
    fade = bend * across * s / (pace * pace)
    return (
        h,
        out * px - turn * ey,
        out * py + turn * ex,
        ex - 2.0 * bend * s * ey - fade * vx,
        ey + 2.0 * bend * s * ex - fade * vy,
    )


@kernel
def barrier(kind: int, gains: Array, px: float, py: float, vx: float, vy: float, radius_m: float) -> Jet:
    """The barrier of that kind, of relative degree one in acceleration and turn rate.

    Args:
        kind: `EXPONENTIAL`, `COLLISION_CONE` or `PARABOLIC`.
        gains: (`N_GAIN`,) a1 (1/s), alpha (1/s), k_lambda (1/m), k_mu (1/s).
        px: p, m, and so on.
        py: see px.
        vx: see px.
        vy: see px.
        radius_m: radius to keep.
    """
    if kind == EXPONENTIAL:
        return exponential(px, py, vx, vy, radius_m, gains[0])
    if kind == COLLISION_CONE:
        return collision_cone(px, py, vx, vy, radius_m)
    return parabolic(px, py, vx, vy, radius_m, gains[2], gains[3])
