"""Exact projection onto a small polyhedron, compiled: reference for the shield's solver, and solver of these filters.

    minimise 1/2 |z - z0|^2   subject to   C z >= d

The solver is the dual active-set method of Goldfarb and Idnani (Mathematical Programming 27, 1983, 1-33) with the
Hessian scaled to the identity. Answers are exact to rounding; infeasible programs are reported.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, IntArray, copy_row, kernel

OPTIMAL, INFEASIBLE, STALLED = 0, 1, 2
TOLERANCE = 1e-10


@kernel
def _dot(a: Array, b: Array) -> float:
    """Return the inner product; rows may be slices of a wider array, for which numpy's version is slow."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def _direction(C: Array, entering: int, active: IntArray, count: int, gram: Array, r: Array) -> bool:
    """Write ``r``, change of active multipliers per unit of the entering one: N N^T r = N c; False if rows depend."""
    for i in range(count):
        for j in range(i + 1):
            total = _dot(C[active[i]], C[active[j]])
            for k in range(j):
                total -= gram[i, k] * gram[j, k]
            if i != j:
                gram[i, j] = total / gram[j, j]
            elif total <= 1e-13 * (1.0 + _dot(C[active[i]], C[active[i]])):
                return False
            else:
                gram[i, i] = math.sqrt(total)
    for i in range(count):
        total = _dot(C[active[i]], C[entering])
        for k in range(i):
            total -= gram[i, k] * r[k]
        r[i] = total / gram[i, i]
    for i in range(count - 1, -1, -1):
        total = r[i]
        for k in range(i + 1, count):
            total -= gram[k, i] * r[k]
        r[i] = total / gram[i, i]
    return True


@kernel
def _make_active(
    C: Array, d: Array, z: Array, entering: int, active: IntArray, dual: Array, count: int, gram: Array
) -> tuple[int, int]:
    """Step until row ``entering`` is satisfied and active; return the status and the new active count."""
    n = C.shape[1]
    r, direction, own = np.zeros(n + 1), np.zeros(n), 0.0
    for _ in range(n + 2):
        if not _direction(C, entering, active, count, gram, r):
            return STALLED, count
        copy_row(direction, C[entering])
        leaving, dual_step, full_step = -1, np.inf, np.inf
        for i in range(count):
            direction -= r[i] * C[active[i]]
            if r[i] > 1e-14 and dual[i] / r[i] < dual_step:  # first multiplier to reach zero
                leaving, dual_step = i, dual[i] / r[i]
        slope = _dot(direction, C[entering])
        if slope > 1e-12 * _dot(C[entering], C[entering]) and count < n:
            full_step = (d[entering] - _dot(C[entering], z)) / slope
        step = min(full_step, dual_step)
        if step == np.inf:
            return INFEASIBLE, count
        if full_step != np.inf:
            z += step * direction
        for i in range(count):
            dual[i] -= step * r[i]
        own += step
        if step == full_step:
            active[count], dual[count] = entering, own
            return OPTIMAL, count + 1
        count -= 1
        for i in range(leaving, count):
            active[i], dual[i] = active[i + 1], dual[i + 1]
    return STALLED, count


@kernel
def project(C: Array, d: Array, z0: Array, z: Array) -> int:
    """Write the nearest point to ``z0`` (n,) with ``C z >= d`` (rows of about unit length) into ``z``.

    Returns:
        `OPTIMAL`, `INFEASIBLE`, or `STALLED`: iteration limit, dependent rows or NaN; do not use the answer.
    """
    rows, n = C.shape
    copy_row(z, z0)
    active, dual, gram = np.zeros(n + 1, np.int64), np.zeros(n + 1), np.zeros((n + 1, n + 1))
    count = 0
    for _ in range(10 * (rows + n) + 10):
        worst, entering = TOLERANCE, -1
        for r in range(rows):
            lack = d[r] - _dot(C[r], z)
            if math.isnan(lack):
                return STALLED
            if lack > worst:
                worst, entering = lack, r
        if entering < 0:
            return OPTIMAL
        status, count = _make_active(C, d, z, entering, active, dual, count, gram)
        if status != OPTIMAL:
            return status
    return STALLED
