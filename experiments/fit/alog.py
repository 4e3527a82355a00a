"""MOOS-IvP's ``.alog``: a line a posting, ``time variable source value``."""

from __future__ import annotations

from pathlib import Path

from .errors import FitError
from .runs import Run
from .streams import Streams

VARIABLES = {
    "NAV_X": "x",
    "NAV_Y": "y",
    "NAV_HEADING": "heading",
    "NAV_SPEED": "speed",
    "DESIRED_SPEED": "told_speed",
    "DESIRED_HEADING": "told_heading",
}
HOLDS_S = 5.0
"""The helm posts desired values when they change, and at least this often."""


def read_alog(path: Path) -> list[Run]:
    """Runs of a MOOS log.

    Raises:
        FitError: it is none, or it tells too little.
    """
    streams = Streams()
    try:
        with path.open(encoding="utf-8") as file:
            for line in file:
                _take(streams, line)
    except UnicodeDecodeError:
        raise FitError(f"{path.name} is no text; give an .alog of pLogger") from None
    names = {what: name for name, what in VARIABLES.items()}
    return streams.runs(path.stem, names, HOLDS_S)


def _take(streams: Streams, line: str) -> None:
    parts = line.split()
    if len(parts) < 4 or parts[1] not in VARIABLES or line.startswith("%"):
        return
    try:
        streams.add(VARIABLES[parts[1]], float(parts[0]), float(parts[3]))
    except ValueError:
        return  # a posting that is no number says nothing
