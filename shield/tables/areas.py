"""Sets of relative positions from which a separation cannot be guaranteed: areas, extent, outline."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit import Array, kernel
from .files import ValueTable, stack_tables
from .lookup import WHOLE_S, Tables, table_value

HEADINGS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0)
"""Relative headings of reported areas; 180 is head-on."""
SPEED_SHARES = ((1.0, 1.0), (0.5, 1.0), (1.0, 0.5))
"""Speed pairs of reported areas: shares of the own and the other's top speed."""
FINE_RANGES = 1000
FINE_BEARINGS = 361


def unsafe(
    table: ValueTable, radius_m: float, heading_deg: float, own_mps: float, other_mps: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return ranges, m, bearings, rad, and where over both the radius cannot be guaranteed."""
    ranges = np.linspace(0.0, table.card.make_grid().rho_last_m, FINE_RANGES)
    bearings = np.radians(np.linspace(-180.0, 180.0, FINE_BEARINGS))
    values = _plane(stack_tables([table]), ranges, bearings, math.radians(heading_deg), own_mps, other_mps)
    return ranges, bearings, values < radius_m


@kernel
def _plane(
    tables: Tables, ranges_m: Array, bearings_rad: Array, heading_rad: float, own_mps: float, other_mps: float
) -> Array:
    """Return values, m, over ranges and bearings, for another boat of a relative heading."""
    values = np.empty((ranges_m.shape[0], bearings_rad.shape[0]))
    for i in range(ranges_m.shape[0]):
        for k in range(bearings_rad.shape[0]):
            x, y = ranges_m[i] * math.sin(bearings_rad[k]), ranges_m[i] * math.cos(bearings_rad[k])
            values[i, k] = table_value(tables, 0, WHOLE_S, x, y, 0.0, heading_rad, own_mps, other_mps)
    return values


def area_m2(table: ValueTable, radius_m: float, heading_deg: float, own_mps: float, other_mps: float) -> float:
    """Return the area, m^2, of the relative positions from which the radius cannot be guaranteed."""
    ranges, _bearings, inside = unsafe(table, radius_m, heading_deg, own_mps, other_mps)
    share = inside[:, :-1].mean(axis=1) * 2.0 * math.pi
    return float((share * ranges).sum() * (ranges[1] - ranges[0]))


def reach_ahead_m(table: ValueTable, radius_m: float, heading_deg: float, own_mps: float, other_mps: float) -> float:
    """Return the largest range dead ahead, m, from which the radius cannot be guaranteed; 0 if there is none."""
    ranges, _, inside = unsafe(table, radius_m, heading_deg, own_mps, other_mps)
    ahead = inside[:, FINE_BEARINGS // 2]
    return float(ranges[ahead].max()) if ahead.any() else 0.0


def area_table(table: ValueTable, radii_m: tuple[float, ...]) -> dict[str, dict[str, list[float]]]:
    """Return areas, m^2, by radius and speed pair, over `HEADINGS_DEG`."""
    grid = table.card.make_grid()
    found: dict[str, dict[str, list[float]]] = {}
    for radius in radii_m:
        rows = found.setdefault(f"{radius:g}", {})
        for own, other in SPEED_SHARES:
            speeds = own * grid.own_top_mps, other * grid.other_top_mps
            name = f"{speeds[0]:g}/{speeds[1]:g}"
            rows[name] = [round(area_m2(table, radius, heading, *speeds), 1) for heading in HEADINGS_DEG]
    return found
