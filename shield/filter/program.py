"""The QP solved by a backend of qpsolvers, with a re-check of the answer.

    minimise 1/2 |z - z0|^2   subject to   C z >= d

with scaled inputs z (see `qp`). An answer counts only if it satisfies every row by residuals computed here. Compiled
code calls these solvers through an address: there is one decision for all of them.
"""

from __future__ import annotations

import ctypes
import logging
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import config
from numba.extending import intrinsic

from ..exceptions import SolverError
from ..jit import Array
from ..workspace import Scene

logger = logging.getLogger(__name__)

COMPILED = "active_set"
"""The compiled solver, `qp.project`; other names are those of qpsolvers."""

ROW_TOLERANCE = 1e-4
"""Largest accepted violation of a unit-length row; the exact check of the command follows anyway."""

OPTIONS: dict[str, dict[str, Any]] = {
    "osqp": {"eps_abs": 1e-7, "eps_rel": 1e-7, "max_iter": 4000},
    "proxqp": {"eps_abs": 1e-8, "check_duality_gap": True, "eps_duality_gap_abs": 1e-8, "max_iter": 1000},
    "scs": {"eps_abs": 1e-7, "eps_rel": 1e-7},
}
"""Settings with which a backend meets `ROW_TOLERANCE`; other backends meet it with their defaults."""


_FAILURES: Counter[str] = Counter()
"""How often each backend raised, in this process."""


@dataclass(frozen=True)
class Program:
    """The QP min 1/2 |z - z0|^2, C z >= d: rows C of unit length, (rows, n), d (rows,), nominal inputs z0 (n,)."""

    C: Array
    d: Array
    z0: Array

    def holds(self, z: Array, tolerance: float = ROW_TOLERANCE) -> bool:
        """Return whether every row of C z >= d - tolerance holds; written so that NaN fails."""
        with np.errstate(all="ignore"):
            return bool((self.C @ z >= self.d - tolerance).all())


Solver = Callable[[Program], Array | None]
"""Solves a QP, or returns None."""


def solver_of(name: str) -> Solver | None:
    """Return the backend of qpsolvers of that name; None for the compiled solver."""
    return None if name == COMPILED else partial(solve, solver=name)


def check_solver(name: str) -> None:
    """Check that a QP solver is available: the compiled one is, a backend of qpsolvers must be installed.

    Raises:
        SolverError: it is not; the message lists those that are.
    """
    if name == COMPILED:
        return
    import qpsolvers  # importing it and scipy takes 0.25 s; the compiled solver needs neither

    if name not in qpsolvers.available_solvers:
        raise SolverError(
            f"QP solver {name!r} is unknown to qpsolvers or not installed; choose one of "
            f"{', '.join([COMPILED, *sorted(qpsolvers.available_solvers)])}, or install its package (pip install)"
        )


def solve(program: Program, solver: str) -> Array | None:
    """Return the solution of the QP, shape (n,), or None if the backend finds none that passes the re-check.

    Fails closed: a backend that raises, or returns anything but n numbers that satisfy every row, has no solution.
    """
    if not all(np.isfinite(numbers).all() for numbers in (program.C, program.d, program.z0)):
        return None  # some backends take half a minute over these
    import qpsolvers
    from scipy.sparse import csc_matrix

    kind = np.asarray if solver in qpsolvers.dense_solvers else csc_matrix
    weight, rows, options = kind(np.eye(len(program.z0))), kind(-program.C), OPTIONS.get(solver, {})
    try:
        with warnings.catch_warnings():  # some warn of infeasible QPs: the answer shows that
            warnings.simplefilter("ignore")
            answer = qpsolvers.solve_qp(weight, -program.z0, rows, -program.d, solver=solver, **options)
    except (qpsolvers.exceptions.QPError, ValueError, ArithmeticError):
        return None
    except Exception as error:  # foreign code may raise anything; the backups remain
        _FAILURES[solver] += 1
        count, why = _FAILURES[solver], type(error).__name__
        if count & (count - 1) == 0:  # the 1st, 2nd, 4th, 8th ...
            logger.warning("QP solver %s failed (%s: %s), %d times so far; backups stand in", solver, why, error, count)
        return None
    if not isinstance(answer, np.ndarray) or answer.shape != program.z0.shape or answer.dtype != np.float64:
        return None
    return answer if program.holds(answer) else None


PLAIN = bool(getattr(config, "DISABLE_JIT", False))
_FORM = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
_CALLED: dict[int, Callable[[int, int], int]] = {}
"""Functions by number where nothing is compiled."""


class SolverCall:
    """A solver as compiled code calls it for the program in a scene; keep it while that may happen."""

    def __init__(self, solver: Solver, scene: Scene) -> None:
        self._solver, self._scene = solver, scene
        self._raised: BaseException | None = None
        self._function = _FORM(self._answer)
        self.address = int(ctypes.cast(self._function, ctypes.c_void_p).value or 0)
        if PLAIN:
            _CALLED[self.address] = self._answer

    def _answer(self, count: int, rows: int) -> int:
        """Write the solution of the program of so many boats and rows into the scene; return whether there is one."""
        scene, n = self._scene, 2 * count
        try:
            z = self._solver(Program(scene.C[:rows, :n], scene.d[:rows], scene.z0[:n]))
            if z is not None:
                scene.z[:n] = z
        except BaseException as error:  # compiled code passes none on
            z, self._raised = None, error
        return int(z is not None)

    def raise_what_was_raised(self) -> None:
        """Raise what a solver raised since the last call of this."""
        raised, self._raised = self._raised, None
        if raised is not None:
            raise raised


@intrinsic
def _call(context: Any, address: Any, count: Any, rows: Any) -> Any:
    """Call a `SolverCall`."""

    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        address, count, rows = given
        whole = ir.IntType(64)
        form = ir.FunctionType(whole, [whole, whole])
        return builder.call(builder.inttoptr(address, form.as_pointer()), [count, rows])

    return types.int64(types.int64, types.int64, types.int64), build


call_solver: Any = (lambda address, count, rows: _CALLED[address](count, rows)) if PLAIN else _call
"""``call_solver(address, count, rows)``: 1 if the solver has an answer, else 0, in compiled code."""
