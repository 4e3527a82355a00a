"""Fitting of platform files to runs: least squares, held-out errors and the margin that covers them, per kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.jit import Array
from steerclear.shield.platforms.files import PlatformFile

from .models import MODELS, Model, Seen, distance_m, errors_of
from .runs import STEP_S, FitError, Run

EVERY, AHEAD, PICKED = 10, 60, 6  # steps between windows, their length, and the interval of the compared steps
WEIGHTS = np.array([1.0, 1.0, 0.02, 0.5])  # weights of x, y (1/m), heading (1/deg) and speed (s/m)
SOFT = 0.5  # scale of the robust loss: larger weighted residuals count less, so that outliers do not dominate the fit
DELAYS_S = np.arange(0.025, 0.8, 0.05)
BEGUN, MOST, HELD = 8, 50, 12
"""Evaluations (each with its derivatives) of every first guess, of the best of them, and of fits for held-out runs."""
FOLDS = 3  # cross-validation folds within each kind of run; a fit to the other folds predicts each
AHEAD_S = (1.0, 3.0, 6.0)
COVERED = 0.99
JUDGED_EVERY = 3  # steps between the moments from which a run is predicted
DIGITS, CHOSEN_BY = 4, 0.9
WORST_M = 3.0
"""If the median held-out error 3 s ahead exceeds this, the log is not of one boat obeying these commands, m."""


@dataclass(frozen=True)
class Fit:
    """A fitted model, its parameters, and the mean square of the weighted residuals."""

    model: Model
    vector: Array
    cost: float

    @property
    def delay_s(self) -> float:
        """Delay from command to effect, s."""
        return float(self.vector[-1])


def residuals(model: Model, vector: Array, runs: Sequence[Run], top_mps: float) -> Array:
    """Return the weighted residuals of all runs, flat."""
    params = model.platform(vector, "fitted", top_mps).pack()
    errors = (errors_of(params, run, float(vector[-1]), EVERY, AHEAD)[:, PICKED - 1 :: PICKED] for run in runs)
    flat = np.concatenate([(error * WEIGHTS).ravel() for error in errors])
    return np.nan_to_num(flat, nan=1e3, posinf=1e3, neginf=-1e3)


def fit_model(model: Model, runs: Sequence[Run], top_mps: float) -> Fit:
    """Return the best fit from several first guesses; only the best start is optimised to the end.

    Between the two stages the delay is chosen from a grid: with stepwise commands a descent gets stuck in it.
    """
    best = min((_least(model, runs, top_mps, start, BEGUN) for start in model.starts()), key=lambda fit: fit.cost)
    for delay_s in DELAYS_S:
        vector = np.append(best.vector[:-1], delay_s)
        cost = float(np.mean(residuals(model, vector, runs, top_mps) ** 2))
        best = Fit(model, vector, cost) if cost < best.cost else best
    return _least(model, runs, top_mps, best.vector, MOST)


def _least(model: Model, runs: Sequence[Run], top_mps: float, start: Array, most: int) -> Fit:
    room = 1e-6 * (model.high - model.low)
    from scipy.optimize import least_squares  # importing it takes a while

    found = least_squares(
        lambda vector: residuals(model, vector, runs, top_mps),
        np.clip(start, model.low + room, model.high - room),
        bounds=(model.low, model.high),
        x_scale=np.maximum(np.abs(start), 0.02 * (model.high - model.low)),
        loss="soft_l1",
        f_scale=SOFT,
        diff_step=1e-3,
        max_nfev=most,
    )
    return Fit(model, found.x, float(np.mean(found.fun**2)))


@dataclass(frozen=True)
class Judged:
    """A fit and its errors, by run."""

    fit: Fit  # to all runs
    seen: Seen  # extremes that the boat reached
    runs: Sequence[Run]  # all of them
    # per run (windows, 3) distances at `AHEAD_S` between predicted and seen position; NaN past its end
    errors_m: Sequence[Array]
    held_out: Sequence[bool]  # per run whether it was predicted by a fit without it

    def errors_of(self, column: int, chosen: Callable[[int], bool]) -> Array:
        """Return errors at one of `AHEAD_S` for the chosen run numbers, m."""
        parts = [errors[:, column] for n, errors in enumerate(self.errors_m) if chosen(n)]
        joined = np.concatenate([np.zeros(0), *parts])
        return np.asarray(joined[np.isfinite(joined)])

    def quantile_m(self, column: int, share: float) -> float:
        """Return an upper quantile of the held-out errors at one of `AHEAD_S`, m; of all errors if none is held out."""
        errors = self.errors_of(column, lambda n: self.held_out[n])
        errors = errors if len(errors) else self.errors_of(column, lambda n: True)
        rank = min(len(errors), int(np.ceil(share * (len(errors) + 1))))
        return float(np.sort(errors)[rank - 1]) if len(errors) else float("nan")

    def median_of_kind(self, kind: str, column: int = 1) -> float:
        """Return the median error of runs of a kind, m; NaN without any."""
        errors = self.errors_of(column, lambda n: self.runs[n].kind == kind)
        return float(np.median(errors)) if len(errors) else float("nan")

    def margin(self) -> tuple[float, float]:
        """Return error 1 s ahead, m, and growth, m/s, that together cover the `COVERED` quantiles at `AHEAD_S`."""
        bounds = [self.quantile_m(column, COVERED) for column in range(len(AHEAD_S))]
        known = [(at, bound) for at, bound in zip(AHEAD_S, bounds, strict=True) if np.isfinite(bound)]
        begin = known[0][1] if known else 0.0
        growths = [(bound - begin) / (at - AHEAD_S[0]) for at, bound in known[1:]]
        return begin, max([0.0, *growths])


def judge(model: Model, runs: Sequence[Run], seen: Seen) -> Judged:
    """Fit a model to all runs, and predict each run by a fit that leaves out its fold."""
    around, top_mps = model.around(seen), seen.top_mps
    fit = fit_model(around, runs, top_mps)
    kinds, dealt, parts = Counter(run.kind for run in runs), Counter[str](), []
    for run in runs:  # -1: the only run of its kind, which is never held out
        parts.append(dealt[run.kind] % FOLDS if kinds[run.kind] > 1 else -1)
        dealt[run.kind] += 1
    fits = {-1: fit}
    for part in sorted(set(parts) - {-1}):
        others = [run for run, its in zip(runs, parts, strict=True) if its != part]
        fits[part] = _least(around, others, top_mps, fit.vector, HELD)
    params = {part: around.platform(one.vector, "fitted", top_mps).pack() for part, one in fits.items()}
    errors = [_at_times(params[part], run, fits[part].delay_s) for run, part in zip(runs, parts, strict=True)]
    return Judged(fit, seen, runs, errors, [part >= 0 for part in parts])


def _at_times(params: Array, run: Run, delay_s: float) -> Array:
    """Return position errors at `AHEAD_S`, (windows, 3), m; NaN where the run is too short."""
    steps = [round(at / STEP_S) for at in AHEAD_S]
    columns = [distance_m(errors_of(params, run, delay_s, JUDGED_EVERY, ahead)[:, -1]) for ahead in steps]
    found = np.full((len(columns[0]), len(columns)), np.nan)
    for k, column in enumerate(columns):
        found[: len(column), k] = column
    return found


def fit_runs(runs: Sequence[Run], kinds: Sequence[str], tell: Callable[[str], None]) -> dict[str, Judged]:
    """Fit the chosen kinds of `MODELS` to the runs of one boat; ``tell`` is called with each kind."""
    seen, found = Seen.of(runs), {}
    for kind in kinds:
        tell(kind)
        found[kind] = judge(MODELS[kind], runs, seen)
    return found


def best_of(found: dict[str, Judged]) -> str:
    """Return the kind with the smallest sum of 90th-percentile errors over `AHEAD_S`."""
    return min(found, key=lambda kind: float(np.nansum([found[kind].quantile_m(c, CHOSEN_BY) for c in range(3)])))


def platform_file(judged: Judged, name: str) -> PlatformFile:
    """Return the platform file of a fit; `FitError` where it does not predict the log, or cannot be steered."""
    worst = judged.quantile_m(1, 0.5)
    if worst > WORST_M:
        raise FitError(
            f"no model predicts these runs: {worst:.1f} m off 3 s ahead, half of the time; is it the log of one boat, "
            "obeying these commands, in still water?"
        )
    vector = np.array([float(f"{value:.{DIGITS}g}") for value in judged.fit.vector])
    try:
        platform = judged.fit.model.platform(vector, name, judged.seen.top_mps, proved=True)
    except PlatformError as error:
        raise FitError(f"what was fitted cannot be steered ({error}); drive a sea-trial and give its log too") from None
    return PlatformFile(platform, measured_of(judged))


def measured_of(judged: Judged) -> dict[str, float]:
    """Return the section ``measured`` of a platform file."""
    error, growth = judged.margin()
    held_out = [out and len(errors) > 0 for out, errors in zip(judged.held_out, judged.errors_m, strict=True)]
    values = {
        "delay_s": judged.fit.delay_s,
        "position_error_m": error,
        "error_growth_mps": growth,
        **{f"error_{at:.0f}_s_m": judged.quantile_m(c, COVERED) for c, at in enumerate(AHEAD_S)},
        "median_3_s_m": judged.quantile_m(1, 0.5),
        "runs": float(len(judged.runs)),
        "held_out": float(sum(held_out)),
    }
    return {key: float(np.ceil(value * 1e3) / 1e3) for key, value in values.items() if np.isfinite(value)}


def results_of(found: dict[str, Judged], chosen: str, file: PlatformFile) -> dict[str, Any]:
    """Return the content of ``--json``."""
    judged = found[chosen]
    kinds = [run.kind for run in judged.runs]
    return {
        "kind": chosen,
        "cost": {kind: one.fit.cost for kind, one in found.items()},
        "measured": dict(file.measured),
        "errors_m": {
            kind: {
                f"{at:g}_s": {"median": one.quantile_m(c, 0.5), "p99": one.quantile_m(c, COVERED)}
                for c, at in enumerate(AHEAD_S)
            }
            for kind, one in found.items()
        },
        "median_3_s_by_manoeuvre_m": {kind: judged.median_of_kind(kind) for kind in sorted(set(kinds))},
        "runs": [
            {"name": run.name, "seconds": run.seconds, "shows": kind, "held_out": held_out}
            for run, kind, held_out in zip(judged.runs, kinds, judged.held_out, strict=True)
        ],
    }
