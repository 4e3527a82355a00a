"""How much of a box of two inputs a row leaves: a polygon clipped by a line. Compiled."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array

from ...jit import kernel

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


@kernel
def share_left(row: Array, need: float, box: Array) -> float:
    """Share in [0, 1] of the box (2, 2; least and greatest of each input) in which ``row z >= need``.

    A box without width in an input is measured in the other; one that is a single point counts as all or nothing.
    """
    if box[0, 1] <= box[0, 0] or box[1, 1] <= box[1, 0]:
        return _share_of_line(row, need, box)
    kept, count = np.empty((8, 2)), 0
    for c in range(4):
        here, there = CORNERS[c], CORNERS[(c + 1) % 4]
        x, y, u, v = box[0, here[0]], box[1, here[1]], box[0, there[0]], box[1, there[1]]
        a, b = row[0] * x + row[1] * y - need, row[0] * u + row[1] * v - need
        if a >= 0.0:
            kept[count, 0], kept[count, 1] = x, y
            count += 1
        if (a >= 0.0) != (b >= 0.0):
            part = a / (a - b)
            kept[count, 0], kept[count, 1] = x + part * (u - x), y + part * (v - y)
            count += 1
    twice = 0.0
    for k in range(count):
        after = (k + 1) % count
        twice += kept[k, 0] * kept[after, 1] - kept[after, 0] * kept[k, 1]
    return 0.5 * abs(twice) / ((box[0, 1] - box[0, 0]) * (box[1, 1] - box[1, 0]))


@kernel
def _share_of_line(row: Array, need: float, box: Array) -> float:
    low = row[0] * box[0, 0] + row[1] * box[1, 0] - need
    high = row[0] * box[0, 1] + row[1] * box[1, 1] - need
    if (low >= 0.0) == (high >= 0.0):
        return 1.0 if low >= 0.0 else 0.0
    return max(low, high) / abs(high - low)
