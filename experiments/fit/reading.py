"""Logs of a boat, a CSV of steps or a black box: runs to fit, and refusal of logs that show too little."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from steerclear.shield.bridge.blackbox import LogReader

from .runs import SEEN, TOLD, FitError, Run, Streams, Tell, spans, untold

LONGEST_RUN_S = 30.0
"""Longer runs are cut into pieces, so that some can be held out."""
FEWEST_RUNS, FEWEST_TURNING_DEG, FEWEST_SPEED_MPS = 3, 20.0, 0.3
CHANGED_SHARE = 0.4
"""A stop, or a start, is seen where the boat's speed changes by so much of its top speed while it is told to."""
COLUMNS: dict[str, tuple[str, tuple[str, ...]]] = {
    "time": ("time", ("t_s", "time_s", "t", "time")),
    "x": ("x (east)", ("x_m", "east_m", "nav_x", "y_e")),
    "y": ("y (north)", ("y_m", "north_m", "nav_y", "x_n")),
    "heading": ("heading", ("heading_deg", "nav_heading", "yaw_deg_unwrapped", "yaw_deg")),
    "speed": ("speed", ("speed_mps", "nav_speed", "fwd_speed")),
    "told_speed": ("speed told", ("told_speed_mps", "cmd_speed_mps", "cmd_speed", "des_speed")),
    "told_heading": ("heading told", ("told_heading_deg", "cmd_heading_deg", "des_heading")),
}
"""Columns of a CSV of steps: in words, and the names that each may have."""


def read_logs(paths: Sequence[Path], boat: str | None = None, tell: Tell = untold) -> list[Run]:
    """Read runs of all logs, long ones in pieces.

    Args:
        paths: of the logs.
        boat: name of the boat, of a black box with several.
        tell: is told what of a log is left out, and why.

    Raises:
        FitError: a log cannot be read or contradicts itself, or together they show too little to fit.
        LogError: it is no black-box log.
    """
    runs: list[Run] = []
    for path in paths:
        kind = path.suffix.lower()
        if kind not in (".csv", ".mcap"):
            raise FitError(f"{path.name} is no log that can be read; give a .csv of steps or a black box (.mcap)")
        if not path.is_file():
            raise FitError(f"there is no log {path}")
        runs += read_csv(path, tell) if kind == ".csv" else read_box(path, tell, boat)
    pieces = [run.part(a, b) for run in runs for a, b in run.bounds(LONGEST_RUN_S)]
    _check_enough(runs, len(pieces))
    return pieces


def read_csv(path: Path, tell: Tell) -> list[Run]:
    """Read a CSV of steps, a row a time, columns known by their names."""
    try:
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = [(number, row) for number, row in enumerate(csv.reader(file), 1) if any(map(str.strip, row))]
    except csv.Error as error:
        raise FitError(f"{path.name} is no CSV ({error}); give a CSV of steps") from None
    if not rows:
        raise FitError(f"{path.name} is empty; give a CSV of steps")
    header = [name.strip() for name in rows[0][1]]
    places = {what: [header.index(name) for name in names if name in header] for what, (_, names) in COLUMNS.items()}
    if not any(places.values()):
        raise FitError(f"{path.name} is no CSV of steps, its first line names none of their columns; give one")
    for what, (words, names) in COLUMNS.items():
        if not places[what]:
            raise FitError(f"{path.name} has no column for {words}; name one {' or '.join(names)}")
    if len(rows) == 1:
        raise FitError(f"{path.name} has no rows; give a CSV of steps")
    streams = Streams(path.stem, tell)
    for number, row in rows[1:]:
        try:
            values = {what: float(row[found[0]]) for what, found in places.items()}
        except (ValueError, IndexError):
            raise FitError(f"{path.name} line {number}: a value is missing or no number; correct it") from None
        if math.isfinite(time_s := values.pop("time")):
            streams.clock(time_s)
            streams.add_all(time_s, **values)
    return streams.runs({what: words for what, (words, _) in COLUMNS.items()}, sampled=True)


def read_box(path: Path, tell: Tell, boat: str | None = None) -> list[Run]:
    """Read one boat of a black box of ours; readings count from when they were true."""
    boats: dict[str, Streams] = {}
    with LogReader(path) as log:
        for tick in log.ticks():
            for name, reading in tick.readings.items():
                streams = boats.setdefault(name, Streams(path.stem, tell))
                if math.isfinite(reading.age_s):
                    streams.clock(reading.read_s)
                    x_m, y_m = reading.position_m
                    streams.add_all(reading.read_s - reading.position_age_s, x=x_m, y=y_m)
                    streams.add("heading", reading.read_s - reading.heading_age_s, math.degrees(reading.heading_rad))
                    streams.add("speed", reading.read_s - reading.velocity_age_s, reading.speed_mps)
            for name, sent in tick.sent.items():
                if sent.delivered and math.isfinite(sent.heading_rad) and math.isfinite(sent.speed_mps):
                    streams = boats.setdefault(name, Streams(path.stem, tell))
                    heading_deg = math.degrees(sent.heading_rad)
                    streams.add_all(sent.sent_s, told_heading=heading_deg, told_speed=sent.speed_mps)
    names = ", ".join(sorted(boats)) or "none"
    if boat is None and len(boats) > 1:
        raise FitError(f"{path.name} tells of boats {names}; name one with --boat")
    if not boats or boat not in (None, *boats):
        raise FitError(f"{path.name} tells nothing of boat {boat or ''}; it has {names}")
    streams = next(iter(boats.values())) if boat is None else boats[boat]
    return streams.runs(dict.fromkeys(SEEN, "readings") | dict.fromkeys(TOLD, "commands sent"))


def _check_enough(runs: Sequence[Run], pieces: int) -> None:
    """See that the boat turned, stopped and started.

    Raises:
        FitError: it did not; the text says what to drive.
    """
    remedy = "drive a sea-trial and give its log"
    if pieces < FEWEST_RUNS:
        raise FitError(f"the logs hold {pieces} runs, fewer than {FEWEST_RUNS}; {remedy}")
    top = max(float(run.seen[:, 3].max()) for run in runs)
    turned, changed = (max(float(np.ptp(run.seen[:, column])) for run in runs) for column in (2, 3))
    if top < FEWEST_SPEED_MPS or turned < FEWEST_TURNING_DEG or changed < FEWEST_SPEED_MPS:
        raise FitError(
            f"too little motion to fit: at most {top:.2f} m/s, {turned:.0f} deg turned, speed changed by "
            f"{changed:.2f} m/s; {remedy}"
        )
    for sign, words, unknown in (
        (-1.0, "told to stop and slow down", "way to stop"),
        (1.0, "told to go and gain speed", "acceleration"),
    ):
        seen = max(_changed(run, sign, top) for run in runs)
        if seen < CHANGED_SHARE * top:
            raise FitError(
                f"the boat was never seen {words}: by at most {seen:.1f} m/s of its {top:.1f}, so that its "
                f"{unknown} is not known; {remedy}"
            )


def _changed(run: Run, sign: float, top_mps: float) -> float:
    """Most that speed fell (sign -1) or rose (1) while told to go slower, or faster, than half of top speed, m/s."""
    asked = spans(sign * (run.told[:, 0] - 0.5 * top_mps) >= 0.0)
    return max((float((sign * (run.seen[a:b, 3] - run.seen[a, 3])).max()) for a, b in asked), default=0.0)
