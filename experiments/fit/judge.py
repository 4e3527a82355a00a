"""How well a model predicts runs it was not fitted to, and the margin that covers what it misses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from steerclear.shield.jit import Array

from .models import Model, Seen
from .rollout import distance_m, errors_of
from .runs import STEP_S, Run
from .solve import Fit, fit_model

FOLDS = 3
"""Runs of each kind are dealt out to so many parts; each part is predicted by a fit to the others."""
AHEAD_S = (1.0, 3.0, 6.0)
COVERED = 0.99
EVERY = 3
"""Steps between the moments from which a run is predicted."""


@dataclass(frozen=True)
class Judged:
    """A fit and its held-out errors.

    Attributes:
        fit: to all runs.
        seen: what the boat did at its hardest.
        errors_m: (windows, 3) distances at `AHEAD_S` between places predicted and seen, of all runs, NaN: past its end.
        whose: (windows,) number of the run.
        held_out: (windows,) whether the run was predicted by a fit that did not know it.
        runs: all of them.
    """

    fit: Fit
    seen: Seen
    errors_m: Array
    whose: Array
    held_out: Array
    runs: Sequence[Run]

    def quantile_m(self, column: int, share: float) -> float:
        """Quantile of the errors at one of `AHEAD_S`: the next larger one, of all errors when none is held out."""
        errors = self.errors_m[self.held_out, column]
        errors = errors[np.isfinite(errors)]
        if len(errors) == 0:
            errors = self.errors_m[np.isfinite(self.errors_m[:, column]), column]
        if len(errors) == 0:
            return float("nan")
        rank = min(len(errors), int(np.ceil(share * (len(errors) + 1))))
        return float(np.sort(errors)[rank - 1])

    def median_of_kind(self, kind: str, column: int = 1) -> float:
        """Median error of the runs of a kind, m; NaN: there is none."""
        mine = np.array([self.runs[int(number)].kind == kind for number in self.whose], dtype=bool)
        errors = self.errors_m[mine, column] if len(mine) else np.zeros(0)
        errors = errors[np.isfinite(errors)]
        return float(np.median(errors)) if len(errors) else float("nan")

    def margin(self) -> tuple[float, float]:
        """Error 1 s ahead, m, and its growth, m/s, which together cover `COVERED` of the errors at `AHEAD_S`."""
        bounds = [self.quantile_m(column, COVERED) for column in range(len(AHEAD_S))]
        known = [(at, bound) for at, bound in zip(AHEAD_S, bounds, strict=True) if np.isfinite(bound)]
        begin = known[0][1] if known else 0.0
        growths = [(bound - begin) / (at - AHEAD_S[0]) for at, bound in known[1:]]
        return begin, max([0.0, *growths])


def judge(model: Model, runs: Sequence[Run], seen: Seen) -> Judged:
    """Fit a model to all runs, and predict each run by a fit to the others of its kind."""
    around = model.around(seen)
    fit = fit_model(around, runs, seen.top_mps, around.starts())
    part = _dealt(runs)
    errors, whose, out = [], [], []
    for fold in range(FOLDS):
        left = [run for run, its in zip(runs, part, strict=True) if its != fold]
        mine = [number for number, its in enumerate(part) if its == fold]
        if not mine or not left:
            continue
        other = fit_model(around, left, seen.top_mps, [fit.vector], most=12)
        _collect(around, other, runs, mine, seen, True, errors, whose, out)
    _collect(around, fit, runs, [n for n, its in enumerate(part) if its < 0], seen, False, errors, whose, out)
    joined = np.concatenate(errors) if errors else np.zeros((0, len(AHEAD_S)))
    return Judged(fit, seen, joined, np.array(whose), np.array(out, dtype=bool), runs)


def _dealt(runs: Sequence[Run]) -> list[int]:
    """Part of each run; -1: the only one of its kind, which is never left out."""
    kinds = [run.kind for run in runs]
    counts: dict[str, int] = {}
    parts = []
    for kind in kinds:
        counts[kind] = counts.get(kind, -1) + 1
        parts.append(counts[kind] % FOLDS if kinds.count(kind) > 1 else -1)
    return parts


def _collect(
    model: Model,
    fit: Fit,
    runs: Sequence[Run],
    numbers: Sequence[int],
    seen: Seen,
    held_out: bool,
    errors: list[Array],
    whose: list[int],
    out: list[bool],
) -> None:
    params = model.platform(fit.vector, "fitted", seen.top_mps).pack()
    for number in numbers:
        found = at_times(params, runs[number], fit.delay_s)
        errors.append(found)
        whose += [number] * len(found)
        out += [held_out] * len(found)


def at_times(params: Array, run: Run, delay_s: float) -> Array:
    """Errors of places at `AHEAD_S`, (windows, 3), m; of a run shorter than one of them NaN there."""
    columns = []
    steps = [round(at / STEP_S) for at in AHEAD_S]
    count = len(errors_of(params, run, delay_s, EVERY, steps[0]))
    for ahead in steps:
        distances = distance_m(errors_of(params, run, delay_s, EVERY, ahead)[:, -1:])[:, 0]
        columns.append(np.concatenate([distances, np.full(count - len(distances), np.nan)]))
    return np.column_stack(columns)
