"""Planning beside the game: a question put at one step, its answer taken at a fixed later one."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as Late
from functools import lru_cache

from . import pddl
from .grid import Cell, GridProblem
from .search import search

DEADLINE_S = 2.0
"""Time a plan has from the question on, s: far beyond what one takes, so that none is missed on a busy machine and
games come out the same everywhere; a missed one is counted."""
KEPT = 4096
Solver = Callable[[GridProblem], list[Cell] | None]


@lru_cache(maxsize=KEPT)
def planned(problem: GridProblem) -> tuple[Cell, ...] | None:
    """The planner's plan, kept: equal problems have equal plans."""
    found = pddl.plan(problem)
    return None if found is None else tuple(found)


def solver_named(name: str) -> Solver:
    """The planner, or A*."""
    return search if name == "astar" else lambda problem: _as_list(planned(problem))


class Thinking:
    """Answers questions in a thread of its own.

    Args:
        solver: from a problem to cells, or None for no plan.
        deadline_s: after which an answer counts as missed, s.

    Attributes:
        missed: answers that came too late.
        times_s: how long each took, s.
    """

    def __init__(self, solver: Solver, deadline_s: float = DEADLINE_S) -> None:
        self._solver, self._deadline_s = solver, deadline_s
        self._pool: ThreadPoolExecutor | None = None
        self._asked: tuple[GridProblem, Future[list[Cell] | None], float] | None = None
        self.missed = 0
        self.times_s: list[float] = []

    def ask(self, problem: GridProblem) -> None:
        """Put a question; one that is open is forgotten."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "planner")
        self._asked = problem, self._pool.submit(self._timed, problem), time.monotonic()

    def answer(self, otherwise: list[Cell] | None) -> tuple[GridProblem, list[Cell] | None] | None:
        """The question and its answer; after the deadline ``otherwise`` in its place. None when nothing was asked."""
        if self._asked is None:
            return None
        problem, future, since = self._asked
        self._asked = None
        try:
            return problem, future.result(max(self._deadline_s - (time.monotonic() - since), 0.0))
        except Late:
            future.cancel()
            self.missed += 1
            return problem, otherwise

    def close(self) -> None:
        """End the thread once its last plan is done."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None

    def _timed(self, problem: GridProblem) -> list[Cell] | None:
        begun = time.perf_counter()
        found = self._solver(problem)
        self.times_s.append(time.perf_counter() - begun)
        return found


def _as_list(plan: tuple[Cell, ...] | None) -> list[Cell] | None:
    return None if plan is None else list(plan)
