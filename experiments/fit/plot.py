"""A picture of a fit: some runs as seen and as predicted, and the errors over the time ahead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .fitting import AHEAD_S, COVERED, Judged
from .models import errors_of
from .runs import STEP_S

AHEAD_STEPS = 60
RUNS = 4


def draw(judged: Judged, name: str, path: Path) -> None:
    """Write the picture.

    Raises:
        OSError: it cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7), layout="constrained")
    axes = figure.subplots(2, 3)
    params = judged.fit.model.platform(judged.fit.vector, name, judged.seen.top_mps).pack()
    for axis, number in zip(axes.flat[:RUNS], _telling(judged), strict=False):
        _draw_run(axis, judged, params, number)
    _draw_errors(axes.flat[4], judged)
    _draw_spread(axes.flat[5], judged)
    figure.suptitle(f"{name}: {judged.fit.model.kind}, {len(judged.runs)} runs; dashed: predicted 6 s ahead, every 3 s")
    figure.savefig(path, dpi=110)


def _telling(judged: Judged) -> list[int]:
    """Runs to show: of each kind the one predicted worst, then others."""
    worst = {n: float(np.nanmax(errors[:, 1], initial=0.0)) for n, errors in enumerate(judged.errors_m)}
    order = sorted(worst, key=lambda n: -worst[n])
    first = list({judged.runs[n].kind: n for n in reversed(order)}.values())
    return (first + [n for n in order if n not in first])[:RUNS]


def _draw_run(axis: Any, judged: Judged, params: np.ndarray, number: int) -> None:
    run = judged.runs[number]
    errors = errors_of(params, run, judged.fit.delay_s, 30, AHEAD_STEPS)
    axis.plot(run.seen[:, 0], run.seen[:, 1], color="0.6", linewidth=3, label="seen")
    for w, error in enumerate(errors):
        places = run.seen[w * 30 + 1 : w * 30 + 1 + AHEAD_STEPS, :2] + error[:, :2]
        axis.plot(places[:, 0], places[:, 1], "--", color="C0", linewidth=1.2)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_title(f"{run.name}: {run.kind}", fontsize=9)
    axis.set_xlabel("x, m")
    axis.set_ylabel("y, m")


def _draw_errors(axis: Any, judged: Judged) -> None:
    medians = [judged.quantile_m(c, 0.5) for c in range(3)]
    tails = [judged.quantile_m(c, COVERED) for c in range(3)]
    axis.plot(AHEAD_S, medians, "o-", label="median")
    axis.plot(AHEAD_S, tails, "s-", label="99 of 100")
    begin, growth = judged.margin()
    margin = [begin + growth * (at - 1.0) for at in AHEAD_S]
    axis.plot(AHEAD_S, margin, ":", color="C3", label="margin")
    axis.set_xlabel("time ahead, s")
    axis.set_ylabel("error of the place, m")
    axis.set_title("runs it was not fitted to", fontsize=9)
    axis.legend(fontsize=8)


def _draw_spread(axis: Any, judged: Judged) -> None:
    errors = np.sort(judged.errors_of(1, lambda n: True))
    if len(errors):
        axis.plot(errors, np.arange(1, len(errors) + 1) / len(errors))
    axis.set_xlabel("error 3 s ahead, m")
    axis.set_ylabel("share of moments")
    axis.set_title(f"step {STEP_S:g} s", fontsize=9)
