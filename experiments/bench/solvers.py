"""The same quadratic programs through every solver that qpsolvers finds, and through the compiled projection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import qpsolvers
from steerclear.experiments.baselines.active_set import OPTIMAL, project
from steerclear.shield.filter.program import Program, solve
from steerclear.shield.jit import Array

from .sampling import REFERENCE
from .timing import quantiles_us, time_calls

COMPILED = "compiled projection"
Solve = Callable[[Program], Array | None]


def solver_times(programs: Sequence[Program], repeats: int) -> list[dict[str, Any]]:
    """Time every solver on the same programs, the shield's default first.

    Returns:
        Per solver `solver`, quantiles in us, `ratio` of its median to the default's, `solved` (share of programs
        with an answer that passes the shield's own check) and `differs` (largest difference from the default's
        answers, scaled inputs; None where they never both answer).
    """
    names = [REFERENCE, *sorted(set(qpsolvers.available_solvers) - {REFERENCE})]
    ways: dict[str, Solve] = {name: lambda program, name=name: solve(program, name) for name in names}
    ways[COMPILED] = _project
    rows = [_time(name, way, programs, repeats) for name, way in ways.items()]
    reference = rows[0]
    return [_against(row, reference) for row in rows]


def _time(name: str, way: Solve, programs: Sequence[Program], repeats: int) -> dict[str, Any]:
    answers = [way(program) for program in programs]  # warms up, too
    runs = [time_calls(lambda k: way(programs[k]), len(programs)) for _ in range(repeats)]
    return {"solver": name, **quantiles_us(runs), "answers": answers}


def _against(row: dict[str, Any], reference: dict[str, Any]) -> dict[str, Any]:
    pairs = zip(row["answers"], reference["answers"], strict=True)
    gaps = [float(np.abs(a - b).max()) for a, b in pairs if a is not None and b is not None]
    solved = sum(answer is not None for answer in row["answers"])
    figures = {name: value for name, value in row.items() if name != "answers"}
    ratio = row["p50_us"] / reference["p50_us"] if row["p50_us"] is not None else None
    share = solved / len(row["answers"]) if row["answers"] else None
    return {**figures, "ratio": ratio, "solved": share, "differs": max(gaps, default=None)}


def _project(program: Program) -> Array | None:
    answer = np.zeros(len(program.z0))
    return answer if project(program.C, program.d, program.z0, answer) == OPTIMAL else None
