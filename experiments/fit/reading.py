"""Logs of any kind, by the endings of their names."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from .alog import read_alog
from .box_log import read_box
from .csv_log import read_csv
from .errors import FitError
from .judge import FEWEST_SPEED_MPS, FEWEST_TURNING_DEG
from .mavlink_log import read_bin, read_tlog
from .runs import Run

ENDINGS = (".csv", ".tlog", ".bin", ".mcap", ".alog")
LONGEST_RUN_S = 30.0
"""Longer runs are cut into pieces, so that some can be held out."""
FEWEST_RUNS = 3


def read_logs(paths: Sequence[Path], boat: str | None = None, system_id: int | None = None) -> list[Run]:
    """Runs of all logs, long ones in pieces.

    Raises:
        FitError: a log cannot be read, or together they show too little to fit.
    """
    runs: list[Run] = []
    for path in paths:
        runs += [piece for run in _read(path, boat, system_id) for piece in _pieces(run)]
    _check_enough(runs)
    return runs


def _read(path: Path, boat: str | None, system_id: int | None) -> list[Run]:
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise FitError(f"{path.name} is no log that can be read; give {', '.join(ENDINGS)}")
    if not path.is_file():
        raise FitError(f"there is no log {path}")
    if ending == ".csv":
        return read_csv(path)
    if ending == ".tlog":
        return read_tlog(path, system_id)
    if ending == ".bin":
        return read_bin(path)
    return read_alog(path) if ending == ".alog" else read_box(path, boat)


def _pieces(run: Run) -> list[Run]:
    count = max(1, round(run.seconds / LONGEST_RUN_S))
    bounds = np.linspace(0, len(run.seen), count + 1).astype(int)
    return [Run(run.name, run.seen[a:b], run.told[a:b]) for a, b in pairwise(bounds)]


def _check_enough(runs: Sequence[Run]) -> None:
    """Whether the boat moved, turned and changed its speed.

    Raises:
        FitError: it did not; the text says what to drive.
    """
    if len(runs) < FEWEST_RUNS:
        raise FitError(f"the logs hold {len(runs)} runs, fewer than {FEWEST_RUNS}; drive a sea-trial and give its log")
    speed = max(float(run.seen[:, 3].max()) for run in runs)
    turned = max(float(np.ptp(run.seen[:, 2])) for run in runs)
    changed = max(float(np.ptp(run.seen[:, 3])) for run in runs)
    if speed < FEWEST_SPEED_MPS or turned < FEWEST_TURNING_DEG or changed < FEWEST_SPEED_MPS:
        raise FitError(
            f"too little motion to fit: at most {speed:.2f} m/s, {turned:.0f} deg turned, speed changed by "
            f"{changed:.2f} m/s; drive a sea-trial and give its log"
        )
