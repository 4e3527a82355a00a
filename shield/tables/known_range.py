"""Ranges beyond which a table has nothing to say: whatever headings and speeds are, it tells enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..jit import Array
from .files import ValueTable
from .lookup import STEPS


def known_ranges_m(tables: Sequence[ValueTable], least_m: float) -> Array:
    """Range from which on each table tells at least some distance, for all headings and speeds of the other.

    Args:
        tables: the tables.
        least_m: the distance, m.

    Returns:
        Ranges, m, for each table and each of its cells of own speed, shape ``(tables, most cells)``; infinite where it
        tells less at its last range, and beyond its cells.
    """
    cells = max((table.values.shape[3] for table in tables), default=1) - 1
    ranges = np.full((len(tables), cells), np.inf)
    for row, table in zip(ranges, tables, strict=True):
        at_nodes = _known_range_m(table, least_m)
        row[: len(at_nodes) - 1] = np.maximum(at_nodes[:-1], at_nodes[1:])
    return ranges


def _known_range_m(table: ValueTable, least_m: float) -> Array:
    """The range for each own speed of the grid, m."""
    grid = table.card.make_grid()
    less = (table.values < least_m * STEPS / grid.cap_m).any(axis=(1, 2, 4))
    beyond = np.append(grid.ranges_m()[1:], np.inf)  # between a node that tells less and the next one nothing is sure
    return np.asarray(np.where(less, beyond[:, None], 0.0).max(axis=0))
