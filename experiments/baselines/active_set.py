"""Exact projection onto a small polyhedron: the shield's QP, compiled.

    minimise 1/2 |z - z0|^2   subject to   C z >= d

solved by the dual active-set method of Goldfarb and Idnani (Mathematical Programming 27, 1983, 1-33) with the
Hessian scaled to the identity. Every answer is exact to rounding, and an infeasible program is told, not guessed.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, IntArray, copy_row, kernel

OPTIMAL = 0
INFEASIBLE = 1
STALLED = 2

NOT_A_NUMBER = -2

TOLERANCE = 1e-10


@kernel
def _dot(a: Array, b: Array) -> float:
    """Inner product; rows may be slices of a wider array, for which numpy's is slow."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def _solve_gram(C: Array, active: IntArray, count: int, rhs: Array, gram: Array, out: Array) -> bool:
    """Solve (N N^T) out = rhs for the active rows N by Cholesky; False when they are dependent."""
    for i in range(count):
        for j in range(i + 1):
            total = _dot(C[active[i]], C[active[j]])
            for k in range(j):
                total -= gram[i, k] * gram[j, k]
            if i == j:
                if total <= 1e-13 * (1.0 + _dot(C[active[i]], C[active[i]])):
                    return False
                gram[i, i] = math.sqrt(total)
            else:
                gram[i, j] = total / gram[j, j]
    for i in range(count):
        total = rhs[i]
        for k in range(i):
            total -= gram[i, k] * out[k]
        out[i] = total / gram[i, i]
    for i in range(count - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, count):
            total -= gram[k, i] * out[k]
        out[i] = total / gram[i, i]
    return True


@kernel
def _most_violated(C: Array, d: Array, z: Array) -> tuple[int, float]:
    """Row with the largest violation relative to its norm; -1 when all hold, `NOT_A_NUMBER` when one cannot be told."""
    worst, index = TOLERANCE, -1
    for r in range(C.shape[0]):
        lack = d[r] - _dot(C[r], z)
        if math.isnan(lack):
            return NOT_A_NUMBER, lack
        if lack > worst:
            worst, index = lack, r
    return index, worst


@kernel
def _dual_direction(C: Array, entering: int, active: IntArray, count: int, gram: Array, rhs: Array, r: Array) -> bool:
    """Change ``r`` of the active multipliers per unit of the entering one."""
    for i in range(count):
        rhs[i] = _dot(C[active[i]], C[entering])
    return _solve_gram(C, active, count, rhs, gram, r)


@kernel
def _first_to_leave(dual: Array, r: Array, count: int) -> tuple[int, float]:
    """Active row whose multiplier reaches zero first, and the step at which it does."""
    blocking, step = -1, np.inf
    for i in range(count):
        if r[i] > 1e-14 and dual[i] / r[i] < step:
            blocking, step = i, dual[i] / r[i]
    return blocking, step


@kernel
def _drop(active: IntArray, dual: Array, leaving: int, count: int) -> None:
    for i in range(leaving, count - 1):
        active[i], dual[i] = active[i + 1], dual[i + 1]


@kernel
def _make_active(
    C: Array, d: Array, z: Array, entering: int, active: IntArray, dual: Array, count: int, gram: Array
) -> tuple[int, int]:
    """Steps until row ``entering`` is satisfied and active; returns the status and the new active count."""
    n = C.shape[1]
    r, rhs, direction = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n)
    own = 0.0
    for _ in range(n + 2):
        if not _dual_direction(C, entering, active, count, gram, rhs, r):
            return STALLED, count
        copy_row(direction, C[entering])
        for i in range(count):
            for k in range(n):
                direction[k] -= r[i] * C[active[i], k]
        slope = _dot(direction, C[entering])
        leaving, dual_step = _first_to_leave(dual, r, count)
        full_step = np.inf
        if slope > 1e-12 * _dot(C[entering], C[entering]) and count < n:
            full_step = (d[entering] - _dot(C[entering], z)) / slope
        step = min(full_step, dual_step)
        if step == np.inf:
            return INFEASIBLE, count
        if full_step != np.inf:
            for k in range(n):
                z[k] += step * direction[k]
        for i in range(count):
            dual[i] -= step * r[i]
        own += step
        if step == full_step:
            active[count], dual[count] = entering, own
            return OPTIMAL, count + 1
        _drop(active, dual, leaving, count)
        count -= 1
    return STALLED, count


@kernel
def project(C: Array, d: Array, z0: Array, z: Array) -> int:
    """Nearest point to ``z0`` with ``C z >= d``, written into ``z``.

    Args:
        C: shape (rows, n), rows of about unit length.
        d: shape (rows,).
        z0: shape (n,).
        z: shape (n,), the answer.

    Returns:
        `OPTIMAL`, `INFEASIBLE`, or `STALLED` when the iteration limit was met or a row is not made of numbers
        (numerical trouble: do not use).
    """
    rows, n = C.shape
    copy_row(z, z0)
    active, dual, gram = np.zeros(n + 1, np.int64), np.zeros(n + 1), np.zeros((n + 1, n + 1))
    count = 0
    for _ in range(10 * (rows + n) + 10):
        entering, _lack = _most_violated(C, d, z)
        if entering == NOT_A_NUMBER:
            return STALLED
        if entering < 0:
            return OPTIMAL
        status, count = _make_active(C, d, z, entering, active, dual, count, gram)
        if status != OPTIMAL:
            return status
    return STALLED
