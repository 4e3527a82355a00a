"""Exact projection onto a small polyhedron: the QP of the batched shield, compiled.

    minimise 1/2 |z - z0|^2   subject to   C z >= d

solved by the dual active-set method of Goldfarb and Idnani (Mathematical Programming 27, 1983, 1-33) with the
Hessian scaled to the identity. Every answer is exact to rounding, and an infeasible program is told, not guessed.
"""

from __future__ import annotations

import math

import numpy as np

from .jit import Array, IntArray, kernel

OPTIMAL = 0
INFEASIBLE = 1
STALLED = 2

TOLERANCE = 1e-10


@kernel
def _solve_gram(C: Array, active: IntArray, count: int, rhs: Array, gram: Array, out: Array) -> bool:
    """Solve (N N^T) out = rhs for the active rows N by Cholesky; False when they are dependent."""
    for i in range(count):
        for j in range(i + 1):
            total = np.dot(C[active[i]], C[active[j]])
            for k in range(j):
                total -= gram[i, k] * gram[j, k]
            if i == j:
                if total <= 1e-13 * (1.0 + np.dot(C[active[i]], C[active[i]])):
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
    """Row with the largest violation relative to its norm; -1 when all hold."""
    worst, index = TOLERANCE, -1
    for r in range(C.shape[0]):
        lack = d[r] - np.dot(C[r], z)
        if lack > worst:
            worst, index = lack, r
    return index, worst


@kernel
def project(C: Array, d: Array, z0: Array, z: Array) -> int:
    """Nearest point to ``z0`` with ``C z >= d``, written into ``z``.

    Args:
        C: shape (rows, n), rows of about unit length.
        d: shape (rows,).
        z0: shape (n,).
        z: shape (n,), the answer.

    Returns:
        `OPTIMAL`, `INFEASIBLE`, or `STALLED` when the iteration limit was met (numerical trouble: do not use).
    """
    rows, n = C.shape
    z[:] = z0
    active = np.zeros(n + 1, np.int64)
    dual = np.zeros(n + 2)
    gram = np.zeros((n + 1, n + 1))
    rhs = np.zeros(n + 1)
    step_dual = np.zeros(n + 1)
    direction = np.zeros(n)
    count = 0
    for _ in range(10 * (rows + n) + 10):
        entering, _lack = _most_violated(C, d, z)
        if entering < 0:
            return OPTIMAL
        entering_dual = 0.0
        while True:
            for i in range(count):
                rhs[i] = np.dot(C[active[i]], C[entering])
            if not _solve_gram(C, active, count, rhs, gram, step_dual):
                return STALLED
            direction[:] = C[entering]
            for i in range(count):
                direction -= step_dual[i] * C[active[i]]
            slope = np.dot(direction, C[entering])
            scale = np.dot(C[entering], C[entering])
            blocking, dual_step = -1, np.inf
            for i in range(count):
                if step_dual[i] > 1e-14 and dual[i] / step_dual[i] < dual_step:
                    blocking, dual_step = i, dual[i] / step_dual[i]
            primal_step = np.inf
            if slope > 1e-12 * scale and count < n:
                primal_step = (d[entering] - np.dot(C[entering], z)) / slope
            step = min(primal_step, dual_step)
            if step == np.inf:
                return INFEASIBLE
            if primal_step != np.inf:
                z += step * direction
            for i in range(count):
                dual[i] -= step * step_dual[i]
            entering_dual += step
            if step == primal_step:
                active[count], dual[count] = entering, entering_dual
                count += 1
                break
            for i in range(blocking, count - 1):
                active[i], dual[i] = active[i + 1], dual[i + 1]
            count -= 1
    return STALLED
