"""The quadratic program of a filter, with the usual relaxation when it has no answer.

    minimise |z - z0|^2   subject to   rows   (barriers and input limits)

When no z meets all rows, each barrier row r is given a slack e_r at the price w e_r^2 and limits stay hard:

    minimise |z - z0|^2 + w sum e_r^2   subject to   c_r z + e_r >= d_r,   limits
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.filter.active_set import OPTIMAL, project
from steerclear.shield.filter.program import holds
from steerclear.shield.jit import Array

from ..jit import kernel

SOLVED, RELAXED, UNSOLVED = 1, 2, 3
TOLERANCE = 1e-7
SLACK_WEIGHT = 1e6


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
