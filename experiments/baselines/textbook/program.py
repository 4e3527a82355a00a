"""The program of a filter, with the usual relaxation.

    minimise |z - z0|^2 + w sum e_r^2   subject to   c_r z + e_r >= d_r,   limits

The slacks e_r of barriers' rows are 0 unless no z meets all rows; limits are hard.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.filter.active_set import OPTIMAL, project
from steerclear.shield.jit import Array

from ...jit import kernel

SOLVED, RELAXED, UNSOLVED = 1, 2, 3
TOLERANCE = 1e-7
SLACK_WEIGHT = 1e6


@kernel
def holds(C: Array, d: Array, z: Array, tolerance: float) -> bool:
    """Whether every row of C z >= d - tolerance holds; written so that NaN fails."""
    for r in range(len(d)):
        total = 0.0
        for c in range(len(z)):
            total += C[r, c] * z[c]
        if not total >= d[r] - tolerance:
            return False
    return True


@kernel
def solve(C: Array, d: Array, hard: int, z0: Array, z: Array, slack: Array) -> int:
    """Write the ``z`` nearest to ``z0`` (n,) that meets C z >= d (rows, n) of unit length, the first ``hard`` limits.

    Where the status is `RELAXED` it does with ``slack`` (rows - hard,); where it is `UNSOLVED` it is ``z0``.
    """
    (rows, n), unit = C.shape, 1.0 / math.sqrt(SLACK_WEIGHT)
    slack[:] = 0.0
    if project(C, d, z0, z) == OPTIMAL and holds(C, d, z, TOLERANCE):
        return SOLVED
    wide, start, answer = np.zeros((rows, n + rows - hard)), np.zeros(n + rows - hard), np.zeros(n + rows - hard)
    wide[:, :n], start[:n], z[:] = C, z0, z0
    for r in range(hard, rows):
        wide[r, n + r - hard] = unit
    if project(wide, d, start, answer) != OPTIMAL or not holds(wide, d, answer, TOLERANCE):
        return UNSOLVED
    z[:], slack[:] = answer[:n], unit * answer[n:]
    return RELAXED
