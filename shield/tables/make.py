"""From a problem to a table with a complete card: solve, solve on a coarser grid, compare, run the full model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..exceptions import TableError
from ..platforms.platform import Platform
from ..platforms.registry import get_platform
from .areas import HEADINGS_DEG, SPEED_SHARES, area_m2, area_table, reach_ahead_m
from .files import ValueTable, pack_values, with_figures
from .margin import model_error, value_loss
from .settings import Problem
from .solve import Notice, solve

RADII_M = (2.5, 4.0)
"""Separation radii for which tables are checked by default."""
COARSER = 1.5
"""Factor on all spacings of the grid for the comparison."""
RUNS = 1000

Stage = Callable[[str], Notice]


def make_table(
    problem: Problem,
    radii_m: tuple[float, ...] = RADII_M,
    *,
    threads: int | None = None,
    checkpoint: Path | None = None,
    runs: int = RUNS,
    stage: Stage | None = None,
) -> ValueTable:
    """Solve a problem and fill in its table's card.

    Args:
        problem: what to solve.
        radii_m: separation radii to check convergence and margin for, m.
        threads: threads to use; by default all cores.
        checkpoint: file with the state of the solve until the table is complete; an interrupted solve resumes from it.
        runs: closed-loop runs of the full model per radius.
        stage: called with the name of each part; returns a function to call with its progress.

    Raises:
        TableError: a radius is outside the table, or the checkpoint belongs to another problem.
    """
    check_radii(problem, radii_m)
    begin = stage or (lambda name: lambda done, total, residual: None)
    parts = (("solve", problem, checkpoint), ("coarser grid", coarser(problem, COARSER), _second(checkpoint)))
    table, coarse = (
        pack_values(part, solve(part, threads=threads, notice=begin(name), checkpoint=kept))
        for name, part, kept in parts
    )
    complete = with_figures(table, **figures(table, coarse, radii_m, runs, begin("runs"), (problem.own, problem.other)))
    for _name, _part, kept in parts:
        if kept is not None:
            kept.unlink(missing_ok=True)
    return complete


def _second(checkpoint: Path | None) -> Path | None:
    """Return the checkpoint of the solve on the coarser grid."""
    return None if checkpoint is None else checkpoint.with_name(checkpoint.name + ".coarser")


def check_radii(problem: Problem, radii_m: tuple[float, ...]) -> None:
    """Raise a `TableError` unless the radii are well inside the table's values."""
    low, high = problem.grid.rho_first_m, 0.8 * problem.grid.cap_m
    for radius in radii_m:
        if not low < radius <= high:
            raise TableError(f"separation {radius:g} m is outside the table's {low:g} to {high:g} m; choose one within")


def coarser(problem: Problem, factor: float) -> Problem:
    """Return the same problem with all grid spacings wider by a factor (speeds have at least 3 nodes)."""
    grid = problem.grid
    fewer = {
        name: max(3, 1 + round((getattr(grid, name) - 1) / factor)) for name in ("n_rho", "n_beta", "n_own", "n_other")
    }
    return replace(problem, grid=replace(grid, **fewer, n_psi=2 * round(grid.n_psi / factor / 2)))


def figures(
    table: ValueTable,
    coarse: ValueTable,
    radii_m: tuple[float, ...],
    runs: int,
    notice: Notice,
    boats: tuple[Platform, Platform] | None = None,
) -> dict[str, Any]:
    """Return the figures of a card: convergence, areas, model error and margin; ``boats`` may be unregistered."""
    own, other = boats or (get_platform(table.card.own), get_platform(table.card.other))
    margins = {}
    for done, radius in enumerate(radii_m):
        margins[f"{radius:g}"] = value_loss(table, radius, runs, min(table.card.horizon_s, 60.0), boats=(own, other))
        notice(done + 1, len(radii_m), 0.0)
    return {
        "checked_radii_m": radii_m,
        "convergence": {f"{radius:g}": convergence(table, coarse, radius) for radius in radii_m},
        "areas_m2": area_table(table, radii_m) | {"reach_ahead_m": reaches(table, radii_m)},
        "levels": level_reaches(table, radii_m),
        "model_error": {
            role: model_error(boat, table.card.dt_s, 500) for role, boat in (("own", own), ("other", other))
        },
        "margin": margins,
    }


def reaches(table: ValueTable, radii_m: tuple[float, ...]) -> dict[str, float]:
    """Return how far ahead the set extends head-on at top speeds, m, by radius."""
    grid = table.card.make_grid()
    tops = grid.own_top_mps, grid.other_top_mps
    return {f"{radius:g}": round(reach_ahead_m(table, radius, 180.0, *tops), 2) for radius in radii_m}


def level_reaches(table: ValueTable, radii_m: tuple[float, ...]) -> dict[str, dict[str, float]]:
    """Return `reaches` at each shorter time that the table stores, by time in s."""
    return {
        f"{time_s:g}": reaches(replace(table, values=values), radii_m)
        for time_s, values in zip(table.card.levels_s, table.levels, strict=True)
    }


def convergence(table: ValueTable, coarse: ValueTable, radius_m: float) -> dict[str, float]:
    """Return the change of the sets' areas on a coarser grid, as shares: mean and largest over headings and speeds."""
    grid, changes = table.card.make_grid(), []
    for own, other in SPEED_SHARES:
        for heading in HEADINGS_DEG:
            place = radius_m, heading, own * grid.own_top_mps, other * grid.other_top_mps
            fine = area_m2(table, *place)
            changes.append(abs(area_m2(coarse, *place) - fine) / fine)
    return {"mean": round(float(np.mean(changes)), 4), "largest": round(float(np.max(changes)), 4)}
