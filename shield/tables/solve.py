"""Solver of a value table: value iteration from V = min(range, cap) down, on several threads, with checkpoints."""

from __future__ import annotations

import io
import os
import zipfile
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..exceptions import TableError
from ..jit import BoolArray
from .lookup import LEVELS_S, pack
from .moves import Moves, moves_of
from .settings import RUDDERS, OtherMay, Problem, places
from .sweep import Pursuit, Ways, sweep, widen

TOLERANCE_M = 5e-4
"""Smaller changes of a value within one step are ignored."""
CONVERGED_M = 5e-3
"""A solve ends when no value has changed by more than this in a step."""
SAVE_EVERY = 20
"""Steps between two checkpoints."""

Notice = Callable[[int, int, float], None]


@dataclass
class Progress:
    """State of a running solve, as saved in a checkpoint."""

    values: NDArray[np.float32]  # flat values, m, float32
    hints: NDArray[np.uint8]  # best rudders of each cell (own * 8 + other)
    active: BoolArray  # places (range, relative heading, bearing) that may still change
    iterations: int = 0  # steps done
    residual_m: float = float("inf")  # largest change in the last step, m
    # packed values at each of `LEVELS_S` passed so far, uint8, ``(passed, size)``
    levels: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))


def start(problem: Problem) -> Progress:
    """Return the values before any play: the distance itself, capped."""
    grid = problem.grid
    ranges = np.minimum(grid.ranges_m(), grid.cap_m).astype(np.float32)
    values = np.repeat(ranges, grid.size // grid.n_rho)
    active = np.ones((grid.n_rho, grid.n_psi, grid.n_beta), bool)
    return Progress(values, np.full(grid.size, 2 * 8 + 2, np.uint8), active)


def steps_of(problem: Problem) -> int:
    """Return the number of steps to the horizon."""
    return max(1, round(problem.horizon_s / problem.dt_s))


def solve(
    problem: Problem,
    *,
    threads: int | None = None,
    notice: Notice | None = None,
    checkpoint: Path | None = None,
) -> Progress:
    """Solve the game by value iteration.

    V starts at min(range, cap). Each iteration lowers it to max over own rudders, min over the other's, of min(closest
    distance in the step, V after it). If the other cooperates, it is max over both. The iteration ends when nothing
    changes or the horizon is reached. The result does not depend on the number of threads.

    Args:
        problem: boats, mode, grid, step and horizon.
        threads: threads to use; by default all cores.
        notice: called with (steps done, steps at most, largest change in m) after each step.
        checkpoint: file for the state, written every `SAVE_EVERY` steps, on interruption (Ctrl-C) and at the end. If it
            exists and belongs to the same problem, the solve resumes from it.

    Raises:
        TableError: the checkpoint is damaged, belongs to another problem or cannot be written.
    """
    solver = _Solver(problem)
    state = _resume(problem, checkpoint) or start(problem)
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        try:
            while state.iterations < steps_of(problem) and state.residual_m > CONVERGED_M:
                solver.step(state, pool)
                _keep_level(problem, state)
                if notice is not None:
                    notice(state.iterations, steps_of(problem), state.residual_m)
                if checkpoint is not None and state.iterations % SAVE_EVERY == 0:
                    _keep(problem, state, checkpoint)
        finally:
            if checkpoint is not None:
                _keep(problem, state, checkpoint)
    return state


def _keep_level(problem: Problem, state: Progress) -> None:
    """Store V(x, T) when the iteration reaches one of the times T of `LEVELS_S`."""
    passed = len(state.levels)
    if passed < len(LEVELS_S) and state.iterations == round(LEVELS_S[passed] / problem.dt_s):
        kept = state.levels.reshape(passed, problem.grid.size)
        state.levels = np.concatenate([kept, pack(state.values, problem.grid.cap_m)[None]])


class _Solver:
    """The arrays of a problem that do not change from step to step."""

    def __init__(self, problem: Problem) -> None:
        grid = problem.grid
        rudders = np.array(RUDDERS)
        self.axes = grid.pack()
        own = moves_of(problem.own, grid.own_speeds_mps(), rudders, problem.dt_s)
        other = moves_of(problem.other, grid.other_speeds_mps(), rudders, problem.dt_s)
        own_speed = places(own.speed_mps, grid.own_top_mps, grid.n_own)
        other_speed = places(other.speed_mps, grid.other_top_mps, grid.n_other)
        self.game = Pursuit(
            self.axes,
            Ways(own.place_m, own.turn_rad, own_speed),
            Ways(other.place_m, other.turn_rad, other_speed),
            problem.other_may is OtherMay.COOPERATIVE,
            _reach(own) + _reach(other),
        )
        own_turn = float(np.abs(own.turn_rad).max())
        self.turns_rad = (own_turn, own_turn + float(np.abs(other.turn_rad).max()))

    def step(self, state: Progress, pool: ThreadPoolExecutor) -> None:
        """Do one value iteration; the state changes only when it is complete."""
        values, changed = state.values.copy(), np.zeros_like(state.active)

        def piece(row: int) -> float:
            return sweep(state.values, values, state.hints, state.active, changed, self.game, TOLERANCE_M, row)

        rows = np.flatnonzero(state.active.any(axis=(1, 2))).tolist()
        residual = max(pool.map(piece, rows), default=0.0)
        active = widen(changed, self.axes, self.game.reach_m, *self.turns_rad)
        state.values, state.active, state.residual_m = values, active, residual
        state.iterations += 1


def _reach(moves: Moves) -> float:
    return float(np.linalg.norm(moves.place_m, axis=-1).max())


def _keep(problem: Problem, state: Progress, path: Path) -> None:
    memory = io.BytesIO()
    np.savez(memory, problem=np.array(repr(problem)), **vars(state))
    write_whole(path, memory.getvalue(), "checkpoint", "name another with --checkpoint")


def write_whole(path: Path, content: bytes, what: str, remedy: str) -> None:
    """Write a file so that no partial one ever exists under its name."""
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(content)
        part.replace(path)
    except OSError as error:
        raise TableError(f"{what} {path} cannot be written ({error}); {remedy}") from error


def _resume(problem: Problem, path: Path | None) -> Progress | None:
    if path is None or not path.exists():
        return None
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            same = str(file["problem"]) == repr(problem)
            values, hints, active, levels = (file[name] for name in ("values", "hints", "active", "levels"))
            state = Progress(values, hints, active, int(file["iterations"]), float(file["residual_m"]), levels)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise TableError(
            f"checkpoint {path} cannot be read ({error}); name another with --checkpoint, or delete it to start afresh"
        ) from error
    if not same:
        raise TableError(f"checkpoint {path} belongs to another problem; delete it or name another with --checkpoint")
    return state
