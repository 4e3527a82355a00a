"""Counting command reversals: how often a boat's commanded turn flips from one side to the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

DEAD_BAND_DEG = 5.0
"""Turns smaller than this are steady steering, not a side."""


def heading_change_deg(later: ArrayLike, earlier: ArrayLike) -> NDArray[np.float64]:
    """Return ``later - earlier`` in [-180, 180), deg."""
    difference = np.asarray(later, dtype=np.float64) - np.asarray(earlier, dtype=np.float64)
    return np.asarray((difference + 180.0) % 360.0 - 180.0)


def count_reversals(command_heading_deg: ArrayLike, heading_deg: ArrayLike) -> int:
    """Count the flips of the commanded side of all boats.

    A boat's commanded side is the sign of (command - heading) where that exceeds `DEAD_BAND_DEG`; between,
    the last side stays. A reversal is a change of that side.

    Args:
        command_heading_deg: (T, n) absolute heading asked of each boat.
        heading_deg: (T, n) heading each boat has at that moment.
    """
    turn = heading_change_deg(command_heading_deg, heading_deg)
    side = np.where(np.abs(turn) > DEAD_BAND_DEG, np.sign(turn), 0.0)
    total = 0
    for column in side.T:
        taken = column[column != 0.0]
        total += int(np.count_nonzero(taken[1:] != taken[:-1]))
    return total
