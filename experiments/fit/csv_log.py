"""CSV of steps: a row a time, columns known by their names."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from steerclear.shield.jit import Array

from .errors import FitError
from .runs import Run, runs_of

COLUMNS: dict[str, tuple[str, ...]] = {
    "time": ("t_s", "time_s", "t", "time"),
    "x (east)": ("x_m", "east_m", "nav_x", "y_e"),
    "y (north)": ("y_m", "north_m", "nav_y", "x_n"),
    "heading": ("heading_deg", "nav_heading", "yaw_deg_unwrapped", "yaw_deg"),
    "speed": ("speed_mps", "nav_speed", "fwd_speed"),
    "speed told": ("told_speed_mps", "cmd_speed_mps", "cmd_speed", "des_speed"),
    "heading told": ("told_heading_deg", "cmd_heading_deg", "des_heading"),
}
"""Names that each column may have."""


def read_csv(path: Path) -> list[Run]:
    """Runs of a CSV file.

    Raises:
        FitError: a column is missing, or a value is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise FitError(f"{path.name} is no CSV ({error}); give a CSV of steps") from None
    if not rows:
        raise FitError(f"{path.name} is empty; give a CSV of steps")
    places = _places(path, [name.strip() for name in rows[0]])
    values = np.array([_numbers(path, number, row, places) for number, row in enumerate(rows[1:], 2)])
    if len(values) == 0:
        raise FitError(f"{path.name} has no rows; give a CSV of steps")
    return runs_of(path.stem, values[:, 0], values[:, 1:5], values[:, 5:7])


def _places(path: Path, header: Sequence[str]) -> list[int]:
    places = []
    for what, names in COLUMNS.items():
        found = [header.index(name) for name in names if name in header]
        if not found:
            raise FitError(f"{path.name} has no column for {what}; name one {' or '.join(names)}")
        places.append(found[0])
    return places


def _numbers(path: Path, line: int, row: Sequence[str], places: Sequence[int]) -> Array:
    try:
        return np.array([float(row[place]) for place in places])
    except (ValueError, IndexError):
        raise FitError(f"{path.name} line {line}: a value is missing or no number; correct it") from None
