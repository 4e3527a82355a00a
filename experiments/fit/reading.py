"""Logs of any kind, by the endings of their names: runs to fit, and refusal of logs that show too little."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from steerclear.shield.bridge.blackbox import LogReader

from .mavlink_log import read_bin, read_tlog
from .runs import FitError, Run
from .streams import Streams, Tell, untold

LONGEST_RUN_S = 30.0
"""Longer runs are cut into pieces, so that some can be held out."""
FEWEST_RUNS = 3
FEWEST_TURNING_DEG, FEWEST_SPEED_MPS = 20.0, 0.3
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
VARIABLES = {
    "NAV_X": "x",
    "NAV_Y": "y",
    "NAV_HEADING": "heading",
    "NAV_SPEED": "speed",
    "DESIRED_SPEED": "told_speed",
    "DESIRED_HEADING": "told_heading",
}
"""Of MOOS-IvP."""
HELM_HOLDS_S = 5.0
"""The helm of MOOS-IvP posts desired values when they change, and at least this often."""


def read_logs(
    paths: Sequence[Path],
    boat: str | None = None,
    system_id: int | None = None,
    tell: Tell = untold,
) -> list[Run]:
    """Read runs of all logs, long ones in pieces.

    Args:
        paths: of the logs.
        boat: name of the boat, of a black box with several.
        system_id: of the boat, of a telemetry log with several.
        tell: is told what of a log is left out, and why.

    Raises:
        FitError: a log cannot be read or contradicts itself, or together they show too little to fit.
    """
    readers: dict[str, Callable[[Path], list[Run]]] = {
        ".csv": lambda path: read_csv(path, tell),
        ".tlog": lambda path: read_tlog(path, system_id, tell),
        ".bin": lambda path: read_bin(path, tell),
        ".mcap": lambda path: read_box(path, boat, tell),
        ".alog": lambda path: read_alog(path, tell),
    }
    runs: list[Run] = []
    for path in paths:
        if path.suffix.lower() not in readers:
            raise FitError(f"{path.name} is no log that can be read; give {', '.join(readers)}")
        if not path.is_file():
            raise FitError(f"there is no log {path}")
        runs += readers[path.suffix.lower()](path)
    pieces = [piece for run in runs for piece in _pieces(run)]
    _check_enough(runs, len(pieces))
    return pieces


def read_csv(path: Path, tell: Tell = untold) -> list[Run]:
    """Read a CSV of steps, a row a time, columns known by their names.

    Raises:
        FitError: a column is missing, or a value is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = [(number, row) for number, row in enumerate(csv.reader(file), 1) if any(map(str.strip, row))]
    except csv.Error as error:
        raise FitError(f"{path.name} is no CSV ({error}); give a CSV of steps") from None
    if not rows:
        raise FitError(f"{path.name} is empty; give a CSV of steps")
    header, places = [name.strip() for name in rows[0][1]], {}
    if not {name for _, names in COLUMNS.values() for name in names} & set(header):
        raise FitError(f"{path.name} is no CSV of steps, its first line names none of their columns; give one")
    for what, (words, names) in COLUMNS.items():
        found = [header.index(name) for name in names if name in header]
        if not found:
            raise FitError(f"{path.name} has no column for {words}; name one {' or '.join(names)}")
        places[what] = found[0]
    if len(rows) == 1:
        raise FitError(f"{path.name} has no rows; give a CSV of steps")
    streams = Streams(path.stem, tell)
    for number, row in rows[1:]:
        try:
            values = {what: float(row[place]) for what, place in places.items()}
        except (ValueError, IndexError):
            raise FitError(f"{path.name} line {number}: a value is missing or no number; correct it") from None
        if math.isfinite(time_s := values.pop("time")):
            streams.clock(time_s)
            for what, value in values.items():
                streams.add(what, time_s, value)
    return streams.runs({what: words for what, (words, _) in COLUMNS.items()}, sampled=True)


def read_alog(path: Path, tell: Tell = untold) -> list[Run]:
    """Read MOOS-IvP's ``.alog``: a line a posting, ``time variable source value``.

    Raises:
        FitError: it tells too little.
    """
    streams = Streams(path.stem, tell)
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            parts = line.split()
            if len(parts) < 4 or parts[1] not in VARIABLES or line.startswith("%"):
                continue
            try:
                time_s, value = float(parts[0]), float(parts[3])
            except ValueError:
                continue  # a posting that is no number says nothing
            streams.clock(time_s)
            streams.add(VARIABLES[parts[1]], time_s, value)
    return streams.runs({what: name for name, what in VARIABLES.items()}, HELM_HOLDS_S)


def read_box(path: Path, boat: str | None, tell: Tell = untold) -> list[Run]:
    """Read one boat of a black box of ours; readings count from when they were true.

    Raises:
        FitError: it tells too little, or of several boats and none was named.
        LogError: it is no black-box log.
    """
    boats: dict[str, Streams] = {}
    with LogReader(path) as log:
        for tick in log.ticks():
            for name, reading in tick.readings.items():
                streams = boats.setdefault(name, Streams(path.stem, tell))
                if not math.isfinite(reading.age_s):
                    continue
                streams.clock(reading.read_s)
                at_s = reading.read_s - reading.position_age_s
                streams.add("x", at_s, reading.position_m[0])
                streams.add("y", at_s, reading.position_m[1])
                streams.add("heading", reading.read_s - reading.heading_age_s, math.degrees(reading.heading_rad))
                streams.add("speed", reading.read_s - reading.velocity_age_s, reading.speed_mps)
            for name, sent in tick.sent.items():
                if sent.delivered and math.isfinite(sent.heading_rad) and math.isfinite(sent.speed_mps):
                    streams = boats.setdefault(name, Streams(path.stem, tell))
                    streams.add("told_heading", sent.sent_s, math.degrees(sent.heading_rad))
                    streams.add("told_speed", sent.sent_s, sent.speed_mps)
    if boat is None and len(boats) > 1:
        raise FitError(f"{path.name} tells of boats {', '.join(sorted(boats))}; name one with --boat")
    name = boat or next(iter(boats), "")
    if name not in boats:
        raise FitError(f"{path.name} tells nothing of boat {name!r}; it has {', '.join(sorted(boats)) or 'none'}")
    told = ("told_speed", "told_heading")
    seen = ("x", "y", "heading", "speed")
    return boats[name].runs(dict.fromkeys(seen, "readings") | dict.fromkeys(told, "commands sent"))


def _pieces(run: Run) -> list[Run]:
    count = max(1, round(run.seconds / LONGEST_RUN_S))
    bounds = np.linspace(0, len(run.seen), count + 1).astype(int)
    return [run.part(a, b) for a, b in pairwise(bounds)]


def _check_enough(runs: Sequence[Run], pieces: int) -> None:
    """See that the boat turned, stopped and started.

    Raises:
        FitError: it did not; the text says what to drive.
    """
    remedy = "drive a sea-trial and give its log"
    if pieces < FEWEST_RUNS:
        raise FitError(f"the logs hold {pieces} runs, fewer than {FEWEST_RUNS}; {remedy}")
    top = max(float(run.seen[:, 3].max()) for run in runs)
    turned = max(float(np.ptp(run.seen[:, 2])) for run in runs)
    changed = max(float(np.ptp(run.seen[:, 3])) for run in runs)
    if top < FEWEST_SPEED_MPS or turned < FEWEST_TURNING_DEG or changed < FEWEST_SPEED_MPS:
        raise FitError(
            f"too little motion to fit: at most {top:.2f} m/s, {turned:.0f} deg turned, speed changed by "
            f"{changed:.2f} m/s; {remedy}"
        )
    for sign, words in ((-1.0, "told to stop and slow down"), (1.0, "told to go and gain speed")):
        seen = max(_changed(run, sign, top) for run in runs)
        if seen < CHANGED_SHARE * top:
            raise FitError(
                f"the boat was never seen {words}: by at most {seen:.1f} m/s of its {top:.1f}, so that its "
                f"{'way to stop' if sign < 0 else 'acceleration'} is not known; {remedy}"
            )


def _changed(run: Run, sign: float, top_mps: float) -> float:
    """Most that speed fell (sign -1) or rose (1) while told to go slower, or faster, than half of top speed, m/s."""
    asked = sign * (run.told[:, 0] - 0.5 * top_mps) >= 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], asked, [False]])))
    spans = [run.seen[a:b, 3] for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return max((float((sign * (span - span[0])).max()) for span in spans), default=0.0)
