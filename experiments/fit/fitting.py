"""From runs to a platform file: every kind of boat is tried, the one that predicts best is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms.files import PlatformFile

from .judge import AHEAD_S, COVERED, Judged, judge
from .models import MODELS, Seen
from .runs import FitError, Run

DIGITS = 4
CHOSEN_BY = 0.9
WORST_M = 3.0
"""Held-out errors 3 s ahead beyond this say that the log is not of one boat obeying these commands."""


def fit_runs(runs: Sequence[Run], kinds: Sequence[str], tell: Callable[[str], None]) -> dict[str, Judged]:
    """Fit each kind of boat.

    Args:
        runs: of one boat.
        kinds: of `MODELS`.
        tell: is told what is being done.
    """
    seen, found = Seen.of(runs), {}
    for kind in kinds:
        tell(kind)
        found[kind] = judge(MODELS[kind], runs, seen)
    return found


def best_of(found: dict[str, Judged]) -> str:
    """The kind whose errors, 90th percentiles at all times ahead, are the smallest together."""
    return min(found, key=lambda kind: float(np.nansum([found[kind].quantile_m(c, CHOSEN_BY) for c in range(3)])))


def platform_file(judged: Judged, name: str) -> PlatformFile:
    """The file of a fitted boat.

    Raises:
        FitError: the log cannot be predicted, or what was fitted is no boat that can be steered.
    """
    worst = judged.quantile_m(1, 0.5)
    if worst > WORST_M:
        raise FitError(
            f"no model predicts these runs: {worst:.1f} m off 3 s ahead, half of the time; is it the log of one boat, "
            "obeying these commands, in still water?"
        )
    model, vector = judged.fit.model, np.array([_rounded(value) for value in judged.fit.vector])
    try:
        platform = model.platform(vector, name, judged.seen.top_mps, proved=True)
    except PlatformError as error:
        raise FitError(f"what was fitted cannot be steered ({error}); drive a sea-trial and give its log too") from None
    return PlatformFile(platform, measured_of(judged))


def measured_of(judged: Judged) -> dict[str, float]:
    """The section ``measured`` of a file."""
    error, growth = judged.margin()
    quantiles = {f"error_{at:.0f}_s_m": judged.quantile_m(c, COVERED) for c, at in enumerate(AHEAD_S)}
    values = {
        "delay_s": judged.fit.delay_s,
        "position_error_m": error,
        "error_growth_mps": growth,
        **quantiles,
        "median_3_s_m": judged.quantile_m(1, 0.5),
        "runs": float(len(judged.runs)),
        "held_out": float(len(set(judged.whose[judged.held_out].tolist()))),
    }
    return {key: float(np.ceil(value * 1e3) / 1e3) for key, value in values.items() if np.isfinite(value)}


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def results_of(found: dict[str, Judged], chosen: str, file: PlatformFile) -> dict[str, Any]:
    """What ``--json`` holds."""
    judged = found[chosen]
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
        "median_3_s_by_manoeuvre_m": {
            kind: judged.median_of_kind(kind) for kind in sorted({run.kind for run in judged.runs})
        },
        "runs": [
            {
                "name": run.name,
                "seconds": run.seconds,
                "shows": run.kind,
                "held_out": bool(judged.held_out[judged.whose == n].all()),
            }
            for n, run in enumerate(judged.runs)
        ],
    }
