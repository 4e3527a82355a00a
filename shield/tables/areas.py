"""Sets of relative positions in which a separation radius cannot be kept: areas, reach, outline."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit import Array
from .files import ValueTable
from .grid import even_place
from .lookup import STEPS

HEADINGS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0)
"""Relative headings at which areas are reported; 180 is head-on."""
SPEED_SHARES = ((1.0, 1.0), (0.5, 1.0), (1.0, 0.5))
"""Speed pairs at which areas are reported: shares of the own and the other's top speed."""
FINE_RANGES = 1000
FINE_BEARINGS = 361


def value_plane(table: ValueTable, heading_deg: float, own_mps: float, other_mps: float) -> Array:
    """Values, m, over (range nodes, bearings of -180 to 180 deg in `FINE_BEARINGS` even places).

    Args:
        table: the table.
        heading_deg: heading of the other relative to the own one, deg clockwise.
        own_mps: own speed, m/s.
        other_mps: the other's speed, m/s.
    """
    bearings = np.linspace(-180.0, 180.0, FINE_BEARINGS)
    star = _half_plane(table, heading_deg, own_mps, other_mps)
    port = _half_plane(table, -heading_deg, own_mps, other_mps)
    nodes = np.linspace(0.0, 180.0, star.shape[1])
    rows = [
        np.where(bearings >= 0.0, np.interp(bearings, nodes, a), np.interp(-bearings, nodes, b))
        for a, b in zip(star, port, strict=True)
    ]
    return np.array(rows)


def _half_plane(table: ValueTable, heading_deg: float, own_mps: float, other_mps: float) -> Array:
    grid = table.card.make_grid()
    j, w = even_place((heading_deg / 360.0 % 1.0) * grid.n_psi, grid.n_psi)
    a, v = even_place(own_mps / grid.own_top_mps * (grid.n_own - 1), grid.n_own - 1)
    b, u = even_place(other_mps / grid.other_top_mps * (grid.n_other - 1), grid.n_other - 1)
    cells = table.values[:, [j, (j + 1) % grid.n_psi]][..., [a, a + 1], :][..., [b, b + 1]].astype(np.float64)
    weights = (np.array([1.0 - w, w]), np.array([1.0 - v, v]), np.array([1.0 - u, u]))
    return np.einsum("rpkab,p,a,b->rk", cells, *weights) * (grid.cap_m / STEPS)


def unsafe(
    table: ValueTable, radius_m: float, heading_deg: float, own_mps: float, other_mps: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Where the radius cannot be kept: ranges, m, bearings, rad, and the answer over both."""
    grid = table.card.make_grid()
    plane = value_plane(table, heading_deg, own_mps, other_mps)
    ranges = np.linspace(0.0, grid.rho_last_m, FINE_RANGES)
    columns = [np.interp(ranges, grid.ranges_m(), column) for column in plane.T]
    values = np.minimum(np.array(columns).T, np.maximum(ranges, grid.rho_first_m)[:, None])
    values[ranges < grid.rho_first_m] = ranges[ranges < grid.rho_first_m, None]
    return ranges, np.radians(np.linspace(-180.0, 180.0, FINE_BEARINGS)), values < radius_m


def area_m2(table: ValueTable, radius_m: float, heading_deg: float, own_mps: float, other_mps: float) -> float:
    """Area, m^2, of the relative positions in which the radius cannot be kept."""
    ranges, _bearings, inside = unsafe(table, radius_m, heading_deg, own_mps, other_mps)
    share = inside[:, :-1].mean(axis=1) * 2.0 * math.pi
    return float((share * ranges).sum() * (ranges[1] - ranges[0]))


def reach_ahead_m(table: ValueTable, radius_m: float, heading_deg: float, own_mps: float, other_mps: float) -> float:
    """Largest range dead ahead, m, from which the radius cannot be kept."""
    ranges, _, inside = unsafe(table, radius_m, heading_deg, own_mps, other_mps)
    ahead = inside[:, FINE_BEARINGS // 2]
    return float(ranges[ahead].max()) if ahead.any() else 0.0


def area_table(table: ValueTable, radii_m: tuple[float, ...]) -> dict[str, dict[str, list[float]]]:
    """Areas, m^2, by radius and speed pair, over `HEADINGS_DEG`."""
    grid = table.card.make_grid()
    found: dict[str, dict[str, list[float]]] = {}
    for radius in radii_m:
        rows = found.setdefault(f"{radius:g}", {})
        for own, other in SPEED_SHARES:
            speeds = own * grid.own_top_mps, other * grid.other_top_mps
            name = f"{speeds[0]:g}/{speeds[1]:g}"
            rows[name] = [round(area_m2(table, radius, heading, *speeds), 1) for heading in HEADINGS_DEG]
    return found
