"""Which places of a grid can change next: those from which one step leads to a changed one, compiled."""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, BoolArray, kernel
from .grid import rho_node


@kernel
def widen(changed: BoolArray, axes: Array, reach_m: float, own_turn_rad: float, psi_turn_rad: float) -> BoolArray:
    """Places from which a changed place (or its mirror image) can be reached in one step.

    Args:
        changed: places (range, relative heading, bearing) that changed.
        axes: description of the grid.
        reach_m: how far the two boats together can move in one step, m.
        own_turn_rad: how far the own boat can turn in one step, rad.
        psi_turn_rad: how far the relative heading can change in one step, rad.

    Returns:
        Booleans of the same shape: True where a value may change in the next iteration.
    """
    n_rho, n_psi, n_beta = changed.shape
    near = _over_headings(_over_ranges(changed, axes, reach_m), psi_turn_rad)
    active = np.zeros((n_rho, n_psi, n_beta), np.bool_)
    for i in range(n_rho):
        reach_beta = own_turn_rad + math.asin(min(reach_m / rho_node(axes, i), 1.0))
        if rho_node(axes, i) <= reach_m:
            reach_beta = math.pi
        width = min(math.ceil(reach_beta / math.pi * (n_beta - 1) + 1e-6) + 1, n_beta)
        for j in range(n_psi):
            for k in range(n_beta):
                if near[i, j, k]:
                    for m in range(k - width, k + width + 1):
                        _mark(active, i, j, m)
    return active


@kernel
def _mark(active: BoolArray, i: int, j: int, k: int) -> None:
    """Mark a place; bearings beyond dead ahead or dead astern are those of the mirror image."""
    n_psi, last = active.shape[1], active.shape[2] - 1
    if 0 <= k <= last:
        active[i, j, k] = True
        if k == 0 or k == last:
            active[i, (-j) % n_psi, k] = True
    else:
        active[i, (-j) % n_psi, min(max(-k if k < 0 else 2 * last - k, 0), last)] = True


@kernel
def _over_ranges(changed: BoolArray, axes: Array, reach_m: float) -> BoolArray:
    n_rho, n_psi, n_beta = changed.shape
    near = np.zeros((n_rho, n_psi, n_beta), np.bool_)
    low = 0
    for i in range(n_rho):
        rho = rho_node(axes, i)
        while low < i and rho_node(axes, low + 1) < rho - reach_m:
            low += 1
        high = i
        while high < n_rho - 1 and rho_node(axes, high) < rho + reach_m:
            high += 1
        for m in range(low, high + 1):
            for j in range(n_psi):
                for k in range(n_beta):
                    if changed[m, j, k]:
                        near[i, j, k] = True
    return near


@kernel
def _over_headings(changed: BoolArray, psi_turn_rad: float) -> BoolArray:
    n_rho, n_psi, n_beta = changed.shape
    near = np.zeros((n_rho, n_psi, n_beta), np.bool_)
    width = min(math.ceil(psi_turn_rad / (2.0 * math.pi) * n_psi - 1e-6), n_psi // 2)
    for i in range(n_rho):
        for j in range(n_psi):
            for k in range(n_beta):
                if changed[i, j, k]:
                    for d in range(-width, width + 1):
                        near[i, (j + d) % n_psi, k] = True
    return near
