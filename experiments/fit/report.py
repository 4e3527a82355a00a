"""Report of a fit: a picture, the boat's behaviour, and what the shield then accounts for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.platforms import Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.files import PlatformFile
from steerclear.shield.platforms.limits import cruise

from .fitting import AHEAD_S, COVERED, Judged
from .models import errors_of
from .runs import STEP_S

SEPARATION_M, MUCH_M, LATE_S = 2.5, 1.0, 0.4
"""Usual separation, m; an error at 3 s, m, and a delay, s, above which the report adds a remark."""
LONGEST_S = 120.0
AHEAD_STEPS, EVERY_STEPS, RUNS = 60, 30, 4
"""Picture of runs: length of predictions, steps between them, and number of runs."""


def draw(judged: Judged, name: str, path: Path) -> None:
    """Draw some runs as seen and as predicted, and the errors ahead; `OSError` where it cannot be written."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7), layout="constrained")
    axes = figure.subplots(2, 3).flat
    params = judged.fit.model.platform(judged.fit.vector, name, judged.seen.top_mps).pack()
    for axis, number in zip(axes[:RUNS], _telling(judged), strict=False):
        run = judged.runs[number]
        axis.plot(run.seen[:, 0], run.seen[:, 1], color="0.6", linewidth=3)
        for w, error in enumerate(errors_of(params, run, judged.fit.delay_s, EVERY_STEPS, AHEAD_STEPS)):
            begin = w * EVERY_STEPS + 1
            x, y = (run.seen[begin : begin + AHEAD_STEPS, :2] + error[:, :2]).T
            axis.plot(x, y, "--", color="C0", linewidth=1.2)
        axis.set_aspect("equal", adjustable="datalim")
        _label(axis, f"{run.name}: {run.kind}", "x, m", "y, m")
    begin_m, growth = judged.margin()
    for values, style, label in (
        ([judged.quantile_m(c, 0.5) for c in range(3)], "o-", "median"),
        ([judged.quantile_m(c, COVERED) for c in range(3)], "s-", "99 of 100"),
        ([begin_m + growth * (at - 1.0) for at in AHEAD_S], ":", "model-error margin"),
    ):
        axes[4].plot(AHEAD_S, values, style, label=label, color="C3" if style == ":" else None)
    axes[4].legend(fontsize=8)
    _label(axes[4], "runs it was not fitted to", "time ahead, s", "error of the place, m")
    errors = np.sort(judged.errors_of(1, lambda n: True))
    axes[5].plot(errors, np.arange(1, len(errors) + 1) / max(1, len(errors)))
    _label(axes[5], f"step {STEP_S:g} s", "error 3 s ahead, m", "share of moments")
    figure.suptitle(f"{name}: {judged.fit.model.kind}, {len(judged.runs)} runs; dashed: predicted 6 s ahead, every 3 s")
    figure.savefig(path, dpi=110)


def _label(axis: Any, title: str, x: str, y: str) -> None:
    axis.set_title(title, fontsize=9)
    axis.set_xlabel(x)
    axis.set_ylabel(y)


def _telling(judged: Judged) -> list[int]:
    """Return the runs to show: of each kind the worst predicted, then others."""
    worst = [float(np.nanmax(errors[:, 1], initial=0.0)) for errors in judged.errors_m]
    order = sorted(range(len(worst)), key=lambda n: -worst[n])
    first = list({judged.runs[n].kind: n for n in reversed(order)}.values())
    return (first + [n for n in order if n not in first])[:RUNS]


def about_the_boat(platform: Platform) -> list[str]:
    """Describe how the boat behaves in its own model, in sentences."""
    top, dt_s = platform.max_speed_mps, 0.1
    params, row = cruise(platform)
    stop_s = speed_up_s = turn_s = fastest = 0.0
    while row[L.SPEED] > 0.05 * top and stop_s < LONGEST_S:
        step_boat(params, row, 0.0, 0.0, dt_s)
        stop_s += dt_s
    stop_m = float(np.hypot(row[L.X], row[L.Y]))
    while row[L.SPEED] < 0.85 * top and speed_up_s < LONGEST_S:
        step_boat(params, row, top, 0.0, dt_s)
        speed_up_s += dt_s
    params, row = cruise(platform)
    while abs(90.0 - row[L.HEADING]) > 5.0 and turn_s < LONGEST_S:
        before = row[L.HEADING]
        step_boat(params, row, top, 90.0 - row[L.HEADING], dt_s)
        fastest = max(fastest, float(row[L.HEADING] - before) / dt_s)
        turn_s += dt_s
    turned_s = turn_s if turn_s < LONGEST_S else float("nan")
    return [
        f"From {top:g} m/s it stops in {stop_s:.1f} s and {stop_m:.1f} m, turns 90 deg (to within 5) in {turned_s:.1f} "
        f"s, at most {fastest:.0f} deg/s; from rest it is up to speed in {speed_up_s:.1f} s."
    ]


def promise(file: PlatformFile) -> list[str]:
    """Describe what the shield accounts for, and what to do where errors are large."""
    measured = file.measured
    if not measured:
        return ["Nothing was measured of it: fit it to a log, which tells delay and model-error margin."]
    error, delay_s = file.error_m(3.0), measured.get("delay_s", 0.0)
    within = ", ".join(f"{measured.get(f'error_{at}_s_m', float('nan')):.2f}" for at in (1, 3, 6))
    lines = [
        f"Commands work after {delay_s:.2f} s; of places predicted 1, 3 and 6 s ahead 99 of 100 are within {within} m.",
        "deploy counts on that delay, rounded up to whole turns of its loop, and keeps the boat "
        f"{file.error_m(1.0):.2f} m farther from everybody for what its model misses; what it misses on the day widens "
        "that, see the log's tracking.",
    ]
    if error > MUCH_M:
        lines.append(
            f"{error:.1f} m at 3 s is much beside a separation of {SEPARATION_M:g} m: drive a longer sea-trial in "
            "still water, tune the autopilot, or keep more separation_m."
        )
    if delay_s > LATE_S:
        lines.append("That delay is long: a faster link or telemetry rate is worth more than any model-error margin.")
    return lines
