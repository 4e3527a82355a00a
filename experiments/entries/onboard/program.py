"""The quadratic program without a solver of others: by our own projection, as the shield solves it by default."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from steerclear.shield.filter.active_set import OPTIMAL, project
from steerclear.shield.jit import Array

ROW_TOLERANCE = 1e-4
"""Largest accepted violation of a unit-length row; the exact check of the command follows anyway."""


@dataclass(frozen=True)
class Program:
    """A program min 1/2 |z - z0|^2, C z >= d."""

    C: Array
    d: Array
    z0: Array


Solver = Callable[[Program], Array | None]


def check_solver(name: str) -> None:
    """Whatever is asked for, there is one."""


def solver_of(name: str) -> Solver:
    """Whatever is asked for, ours: it takes arrays, and so stands between the stages."""
    return partial(solve, solver=name)


def solve(program: Program, solver: str) -> Array | None:
    """Answer of the program, shape (n,), or None when there is none that satisfies every row."""
    numbers = (program.C, program.d, program.z0)
    if not all(np.isfinite(part).all() for part in numbers):
        return None
    z = np.zeros(len(program.z0))
    if project(*numbers, z) != OPTIMAL or not (program.C @ z >= program.d - ROW_TOLERANCE).all():
        return None
    return z
