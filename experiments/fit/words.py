"""What a fit says to the user, in sentences and as a picture."""

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

SEPARATION_M = 2.5
MUCH_M = 1.0
LATE_S = 0.4
LONGEST_S = 120.0


def what_it_does(platform: Platform) -> dict[str, float]:
    """How the boat behaves in its own model, from top speed.

    Returns:
        ``stop_s`` and ``stop_m``: until below 5 % of top speed; ``turn_90_s``: until within 5 deg of a right angle
        (NaN: longer than `LONGEST_S`); ``turn_rate_dps``: the highest on the way; ``speed_up_s``: from rest to 90 %.
    """
    top, dt_s = platform.max_speed_mps, 0.1
    params, row = cruise(platform)
    stop_s = 0.0
    while row[L.SPEED] > 0.05 * top and stop_s < LONGEST_S:
        step_boat(params, row, 0.0, 0.0, dt_s)
        stop_s += dt_s
    stop_m = float(np.hypot(row[L.X], row[L.Y]))
    speed_up_s = 0.0
    while row[L.SPEED] < 0.85 * top and speed_up_s < LONGEST_S:
        step_boat(params, row, top, 0.0, dt_s)
        speed_up_s += dt_s
    params, row = cruise(platform)
    turn_s, fastest = 0.0, 0.0
    while abs(90.0 - row[L.HEADING]) > 5.0 and turn_s < LONGEST_S:
        before = row[L.HEADING]
        step_boat(params, row, top, 90.0 - row[L.HEADING], dt_s)
        fastest = max(fastest, float(row[L.HEADING] - before) / dt_s)
        turn_s += dt_s
    turned = turn_s if turn_s < LONGEST_S else float("nan")
    return {
        "stop_s": stop_s,
        "stop_m": stop_m,
        "turn_90_s": turned,
        "turn_rate_dps": fastest,
        "speed_up_s": speed_up_s,
    }


def about_the_boat(platform: Platform) -> list[str]:
    """The same in sentences."""
    does = what_it_does(platform)
    top = platform.max_speed_mps
    return [
        f"From {top:g} m/s it stops in {does['stop_s']:.1f} s and {does['stop_m']:.1f} m, turns 90 deg (to within 5) "
        f"in {does['turn_90_s']:.1f} s, at most {does['turn_rate_dps']:.0f} deg/s; from rest it is up to speed in "
        f"{does['speed_up_s']:.1f} s."
    ]


def promise(file: PlatformFile) -> list[str]:
    """What the shield then keeps, and what to do where that is little."""
    measured = file.measured
    if not measured:
        return ["Nothing was measured of it: fit it to a log, so that the shield knows delay and margin."]
    error = file.error_m(3.0)
    lines = [
        f"Commands work after {measured.get('delay_s', 0.0):.2f} s; of places predicted 1, 3 and 6 s ahead 99 of 100 "
        f"are within {', '.join(format(measured.get(f'error_{at}_s_m', float('nan')), '.2f') for at in (1, 3, 6))} m.",
        "deploy counts on that delay, rounded up to whole turns of its loop, and keeps the boat "
        f"{file.error_m(1.0):.2f} m farther from everybody for what its model misses; what it misses on the day widens "
        "that, see the log's tracking.",
    ]
    if error > MUCH_M:
        lines.append(
            f"{error:.1f} m at 3 s is much beside a separation of {SEPARATION_M:g} m: drive a longer sea-trial in "
            "still water, tune the autopilot, or keep more separation_m."
        )
    if measured.get("delay_s", 0.0) > LATE_S:
        lines.append("That delay is long: a faster link or telemetry rate is worth more than any margin.")
    return lines


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
