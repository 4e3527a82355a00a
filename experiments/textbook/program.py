"""The quadratic program of a filter, with the usual relaxation when it has no answer.

    minimise |z - z0|^2   subject to   rows   (barriers and input limits)

When no z meets all rows, each barrier row r is given a slack e_r at the price w e_r^2 and limits stay hard:

    minimise |z - z0|^2 + w sum e_r^2   subject to   c_r z + e_r >= d_r,   limits
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.filter.active_set import OPTIMAL, project
from steerclear.shield.jit import Array

from ..jit import kernel

SOLVED = 1
RELAXED = 2
UNSOLVED = 3

TOLERANCE = 1e-7
SLACK_WEIGHT = 1e6


@kernel
def holds(C: Array, d: Array, z: Array, tolerance: float) -> bool:
    """Whether every row of ``C z >= d`` holds; a row that is not made of numbers does not."""
    for r in range(C.shape[0]):
        total = 0.0
        for k in range(C.shape[1]):
            total += C[r, k] * z[k]
        if not total >= d[r] - tolerance:
            return False
    return True


@kernel
def solve(C: Array, d: Array, hard: int, z0: Array, z: Array, slack: Array) -> int:
    """Nearest point to ``z0`` that meets the rows, else the relaxed one.

    Args:
        C: (rows, n), each row of about unit length; the first ``hard`` are limits, which ``z0`` meets.
        d: (rows,).
        hard: how many rows have no slack.
        z0: (n,) wanted inputs.
        z: (n,) written: the answer; ``z0`` when the status is `UNSOLVED`.
        slack: (rows - hard,) written: slack of each barrier row, 0 unless relaxed.

    Returns:
        `SOLVED`, `RELAXED` or `UNSOLVED`.
    """
    slack[:] = 0.0
    if project(C, d, z0, z) == OPTIMAL and holds(C, d, z, TOLERANCE):
        return SOLVED
    return _relaxed(C, d, hard, z0, z, slack)


@kernel
def _relaxed(C: Array, d: Array, hard: int, z0: Array, z: Array, slack: Array) -> int:
    rows, n = C.shape
    unit = 1.0 / math.sqrt(SLACK_WEIGHT)
    wide = np.zeros((rows, n + rows - hard))
    wide[:, :n] = C
    for r in range(hard, rows):
        wide[r, n + r - hard] = unit
    start, answer = np.zeros(wide.shape[1]), np.zeros(wide.shape[1])
    start[:n] = z0
    if project(wide, d, start, answer) != OPTIMAL or not holds(wide, d, answer, TOLERANCE):
        z[:] = z0
        return UNSOLVED
    z[:] = answer[:n]
    slack[:] = unit * answer[n:]
    return RELAXED
