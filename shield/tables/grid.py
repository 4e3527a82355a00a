"""The grid of a value table: range, relative heading, bearing and both speeds, in the own boat's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..exceptions import TableError
from ..jit import Array, kernel

N_AXES = 11
"""Numbers that describe a grid to compiled code, see `Grid.pack`."""
RHO_FIRST, RHO_STEP, RHO_GROWTH = 0, 1, 2
N_RHO, N_PSI, N_BETA, N_OWN, N_OTHER = 3, 4, 5, 6, 7
OWN_TOP, OTHER_TOP, CAP = 8, 9, 10


@kernel
def rho_node(axes: Array, i: int) -> float:
    """Return the range of node i, m; the spacing grows evenly from node to node."""
    return axes[RHO_FIRST] + axes[RHO_STEP] * i + 0.5 * axes[RHO_GROWTH] * i * (i - 1)


@kernel
def rho_place(axes: Array, rho_m: float) -> tuple[int, float]:
    """Return the cell index and place in it (0 to 1) of a range; ranges outside the grid are clamped to its ends."""
    last = int(axes[N_RHO]) - 1
    half = axes[RHO_STEP] - 0.5 * axes[RHO_GROWTH]
    above = rho_m - axes[RHO_FIRST]
    if not above > 0.0:
        return 0, 0.0
    i = int((math.sqrt(half * half + 2.0 * axes[RHO_GROWTH] * above) - half) / axes[RHO_GROWTH])
    if i >= last:
        return last - 1, 1.0
    place = (rho_m - rho_node(axes, i)) / (axes[RHO_STEP] + axes[RHO_GROWTH] * i)
    return i, min(max(place, 0.0), 1.0)


@kernel
def even_place(value: float, n_cells: int) -> tuple[int, float]:
    """Return the cell index and place of a value counted in cells, clamped to 0 .. n_cells."""
    if not value > 0.0:
        return 0, 0.0
    if value >= n_cells:
        return n_cells - 1, 1.0
    i = int(value)
    return i, value - i


@kernel
def blend(
    data: NDArray[Any],
    offset: int,
    axes: Array,
    rho: tuple[int, float],
    psi: tuple[int, float],
    beta: tuple[int, float],
    own: tuple[int, float],
    other: tuple[int, float],
) -> float:
    """Interpolate multilinearly between the corners of a cell; corners of zero weight are not read."""
    n_psi, n_beta, n_own, n_other = int(axes[N_PSI]), int(axes[N_BETA]), int(axes[N_OWN]), int(axes[N_OTHER])
    start = offset + own[0] * n_other + other[0]
    block = n_own * n_other
    total = 0.0
    for di in range(2):
        w_rho = rho[1] if di == 1 else 1.0 - rho[1]
        if w_rho == 0.0:
            continue
        for dj in range(2):
            w_psi = w_rho * (psi[1] if dj == 1 else 1.0 - psi[1])
            if w_psi == 0.0:
                continue
            j = psi[0] + dj
            if j >= n_psi:
                j -= n_psi
            line = ((rho[0] + di) * n_psi + j) * n_beta + beta[0]
            for dk in range(2):
                weight = w_psi * (beta[1] if dk == 1 else 1.0 - beta[1])
                if weight != 0.0:
                    total += weight * _speeds(data, start + (line + dk) * block, n_other, own[1], other[1])
    return total


@kernel
def _speeds(data: NDArray[Any], at: int, n_other: int, own: float, other: float) -> float:
    """Interpolate over the two speeds at one corner of position and heading."""
    low = float(data[at])
    if other != 0.0:
        low += other * (float(data[at + 1]) - low)
    if own == 0.0:
        return low
    at += n_other
    high = float(data[at])
    if other != 0.0:
        high += other * (float(data[at + 1]) - high)
    return low + own * (high - low)


@dataclass(frozen=True)
class Grid:
    """Nodes of a value table.

    Order of the values: (range, relative heading, bearing, own speed, other's speed), row-major. Relative heading is
    periodic from 0. Bearing covers 0 to 180 deg; the other side is its mirror image. Speeds start at 0.

    Raises:
        TableError: too few nodes, or ranges or speeds out of order.
    """

    rho_last_m: float  # largest range, m
    n_rho: int  # number of ranges, relative headings, bearings
    n_psi: int
    n_beta: int
    n_own: int  # number of speeds of the own boat and of the other
    n_other: int
    own_top_mps: float  # the highest speeds, m/s
    other_top_mps: float
    rho_first_m: float = 1.0  # smallest range, m; nearer, the value is the range itself
    rho_ratio: float = 5.0  # spacing of the farthest ranges over that of the nearest
    cap_m: float = 6.0  # largest value, m; higher ones are cut to it

    def __post_init__(self) -> None:
        if min(self.n_rho, self.n_psi, self.n_beta, self.n_own, self.n_other) < 2:
            raise TableError("a value table needs at least 2 nodes along each axis; raise the numbers of nodes")
        if not 0.0 < self.rho_first_m < self.cap_m <= self.rho_last_m < math.inf:
            raise TableError(
                f"ranges of a value table must obey 0 < first ({self.rho_first_m:g}) < cap ({self.cap_m:g}) "
                f"<= last ({self.rho_last_m:g}) m"
            )
        if not (self.own_top_mps > 0.0 and self.other_top_mps > 0.0 and self.rho_ratio > 1.0):
            raise TableError("a value table needs top speeds > 0 and rho_ratio > 1")

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        """Nodes along each axis, in the order of the values."""
        return self.n_rho, self.n_psi, self.n_beta, self.n_own, self.n_other

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)

    @property
    def psi_step_rad(self) -> float:
        """Spacing of relative headings, rad."""
        return 2.0 * math.pi / self.n_psi

    @property
    def beta_step_rad(self) -> float:
        """Spacing of bearings, rad."""
        return math.pi / (self.n_beta - 1)

    def pack(self) -> Array:
        """Return the description for compiled code, shape ``(N_AXES,)``."""
        gaps = self.n_rho - 1
        mean = (self.rho_last_m - self.rho_first_m) / gaps
        step = 2.0 * mean / (1.0 + self.rho_ratio)
        growth = step * (self.rho_ratio - 1.0) / max(gaps - 1, 1)
        sizes = [float(n) for n in self.shape]
        return np.array([self.rho_first_m, step, growth, *sizes, self.own_top_mps, self.other_top_mps, self.cap_m])

    def ranges_m(self) -> Array:
        """Return the ranges of the nodes, m, shape ``(n_rho,)``."""
        axes = self.pack()
        return np.array([rho_node(axes, i) for i in range(self.n_rho)])

    def own_speeds_mps(self) -> Array:
        """Return the own speeds of the nodes, m/s."""
        return np.linspace(0.0, self.own_top_mps, self.n_own)

    def other_speeds_mps(self) -> Array:
        """Return the other's speeds of the nodes, m/s."""
        return np.linspace(0.0, self.other_top_mps, self.n_other)
