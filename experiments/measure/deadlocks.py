"""Deadlocks: team-mates that keep each other from moving."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array, BoolArray

from ..jit import kernel

STILL_MPS = 0.2
"""A boat slower than this stands still; one that is asked for more wants to move."""
DEADLOCK_S = 10.0
"""Two team-mates that stand still for longer than this, both wanting to move, are deadlocked."""


@kernel
def deadlocks(speed_mps: Array, wanted_mps: Array, own: BoolArray, longest: int, out: Array) -> None:
    """Count pairs of own boats that both want to move and both stay below `STILL_MPS` for over ``longest`` steps.

    A pair counts once for every time that begins.

    Args:
        speed_mps: (T, B, n) speed after each step of B games.
        wanted_mps: (T, B, n) speed wanted in it, before a shield.
        own: (n,).
        longest: steps that are still no deadlock.
        out: (B,) written.
    """
    n = speed_mps.shape[2]
    for b in range(speed_mps.shape[1]):
        out[b] = 0.0
        still = np.zeros((n, n), np.int64)
        for t in range(speed_mps.shape[0]):
            for i in range(n):
                if not own[i]:
                    continue
                stuck = speed_mps[t, b, i] < STILL_MPS and wanted_mps[t, b, i] > STILL_MPS
                for j in range(i):
                    if not own[j]:
                        continue
                    if stuck and speed_mps[t, b, j] < STILL_MPS and wanted_mps[t, b, j] > STILL_MPS:
                        still[i, j] += 1
                        if still[i, j] == longest + 1:
                            out[b] += 1.0
                    else:
                        still[i, j] = 0


def count_deadlocks(speed_mps: Array, wanted_mps: Array, own: BoolArray, dt_s: float) -> int:
    """Count the deadlocks of one game's own boats.

    Args:
        speed_mps: (T, n) after each step.
        wanted_mps: (T, n).
        own: (n,).
        dt_s: length of a step, s.
    """
    found = np.empty(1)
    deadlocks(
        np.ascontiguousarray(speed_mps[:, None], dtype=np.float64),
        np.ascontiguousarray(wanted_mps[:, None], dtype=np.float64),
        np.ascontiguousarray(own),
        round(DEADLOCK_S / dt_s),
        found,
    )
    return int(found[0])
