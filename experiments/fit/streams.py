"""Messages of a log as streams of values, put together to rows at the times of its positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from steerclear.shield.jit import Array

from .errors import FitError
from .runs import SAME_S, Run, runs_of

SPENT_S = 1.0
"""A command not repeated for this long is no longer in force."""

NEEDED = {
    "x": "positions",
    "y": "positions",
    "heading": "headings",
    "speed": "speeds",
    "told_speed": "speeds commanded",
    "told_heading": "headings commanded",
}


class Streams:
    """Values by what they are, each with its time."""

    def __init__(self) -> None:
        self._values: dict[str, list[tuple[float, float]]] = {name: [] for name in NEEDED}

    def add(self, what: str, time_s: float, value: float) -> None:
        """Note a value."""
        self._values[what].append((time_s, value))

    def add_velocity_told(self, time_s: float, east_mps: float, north_mps: float) -> None:
        """Note a command given as a velocity: its way and its size."""
        self.add("told_heading", time_s, float(np.degrees(np.arctan2(east_mps, north_mps))))
        self.add("told_speed", time_s, float(np.hypot(east_mps, north_mps)))

    def runs(self, name: str, names: Mapping[str, str], holds_s: float = SPENT_S) -> list[Run]:
        """Runs at the times of the positions.

        Args:
            name: of the log.
            names: message names that would have told each of `NEEDED`, for the words of an error.
            holds_s: how long a command is in force, s.

        Raises:
            FitError: something is never told.
        """
        missing = [what for what, values in self._values.items() if not values]
        if missing:
            words = dict.fromkeys(f"{NEEDED[what]} ({names[what]})" for what in missing)
            raise FitError(f"{name} tells no {', no '.join(words)}; give a log in which the boat was commanded")
        streams = {what: _sorted(values) for what, values in self._values.items()}
        times = streams["x"][0]
        seen = [_between(streams[what], times, angle=what == "heading") for what in ("x", "y", "heading", "speed")]
        told = [_held(streams[what], times, holds_s) for what in ("told_speed", "told_heading")]
        return runs_of(name, times, np.column_stack(seen), np.column_stack(told))


def _sorted(values: Sequence[tuple[float, float]]) -> Array:
    pairs = np.array(values)
    return np.asarray(pairs[np.argsort(pairs[:, 0], kind="stable")].T)


def _between(stream: Array, times: Array, angle: bool) -> Array:
    """Values between those told, NaN more than a second from any."""
    values = np.unwrap(stream[1], period=360.0) if angle else stream[1]
    found = np.interp(times, stream[0], values)
    after = np.clip(np.searchsorted(stream[0], times), 0, len(stream[0]) - 1)
    apart = np.minimum(np.abs(stream[0][after] - times), np.abs(stream[0][np.maximum(after - 1, 0)] - times))
    return np.where(apart <= SPENT_S, found, np.nan)


def _held(stream: Array, times: Array, holds_s: float) -> Array:
    """The last value told before each time, NaN where that is too long ago."""
    last = np.searchsorted(stream[0], times + SAME_S, side="right") - 1
    known = (last >= 0) & (times - stream[0][np.maximum(last, 0)] <= holds_s)
    return np.where(known, stream[1][np.maximum(last, 0)], np.nan)
