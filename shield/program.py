"""The quadratic program through qpsolvers: build, solve, re-check.

    minimise 1/2 |z - z0|^2   subject to   C z >= d

with scaled inputs z (see `rows`). An answer counts only when it satisfies every row by our own residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import qpsolvers

from .exceptions import SolverError
from .jit import Array, kernel

ROW_TOLERANCE = 1e-4
"""Largest accepted violation of a unit-length row; the exact check of the command follows anyway."""

OPTIONS: dict[str, dict[str, Any]] = {
    "osqp": {"eps_abs": 1e-7, "eps_rel": 1e-7, "max_iter": 4000},
    "proxqp": {"eps_abs": 1e-8},
    "scs": {"eps_abs": 1e-7, "eps_rel": 1e-7},
}
"""Settings under which a backend meets `ROW_TOLERANCE`; the others do at their defaults."""


@dataclass(frozen=True)
class Program:
    """A program min 1/2 |z - z0|^2, C z >= d.

    Attributes:
        C: (rows, n) rows of unit length.
        d: (rows,).
        z0: (n,) the wanted inputs.
    """

    C: Array
    d: Array
    z0: Array


def check_solver(name: str) -> None:
    """Check that a QP backend is installed.

    Raises:
        SolverError: it is not; the message lists those that are.
    """
    if name not in qpsolvers.available_solvers:
        raise SolverError(
            f"QP solver {name!r} is not installed; installed: {', '.join(sorted(qpsolvers.available_solvers))} "
            f"(pip install {name})"
        )


@lru_cache(maxsize=64)
def _identity(n: int) -> Array:
    return np.eye(n)


@kernel
def holds(C: Array, d: Array, z: Array, tolerance: float) -> bool:
    """Whether every row of C z >= d - tolerance holds; written so that NaN fails."""
    for r in range(C.shape[0]):
        total = 0.0
        for c in range(C.shape[1]):
            total += C[r, c] * z[c]
        if not total >= d[r] - tolerance:
            return False
    return True


def solve(program: Program, solver: str) -> Array | None:
    """Answer of the program, shape (n,), or None when the backend finds none that passes our own check."""
    n = program.z0.shape[0]
    try:
        answer = qpsolvers.solve_qp(
            _identity(n), -program.z0, -program.C, -program.d, solver=solver, **OPTIONS.get(solver, {})
        )
    except (qpsolvers.exceptions.QPError, ValueError, ArithmeticError):
        return None
    if answer is None or answer.shape != (n,):
        return None
    return answer if holds(program.C, program.d, answer, ROW_TOLERANCE) else None
