"""`Streams`: what a log tells, each value with a time of its own, put on a grid of equal steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from steerclear.shield.jit import Array

from .consistency import consistent
from .runs import SHORTEST_S, STEP_S, FitError, Run

Tell = Callable[[str], None]
"""Is told in a sentence what of a log is left out, and why."""


def untold(words: str) -> None:
    """Nobody is told."""


SPENT_S = 1.0
"""A command not repeated for this long is no longer in force, s; a run ends where nothing was seen for so long."""
SET_BACK_S = 0.2
"""A log whose time falls by more than this had its clock set back, s; less is the order in which messages came."""
SELDOM_S = 0.25
"""Commands that were only looked at every so many seconds or less often tell no delay."""
SAME_S = 1e-4
"""Times closer together are the same, s."""
UNKNOWN_HEADINGS = (655.35, 65535.0)
"""What MAVLink writes for a heading that is not known, deg."""

NEEDED = {
    "x": "positions",
    "y": "positions",
    "heading": "headings",
    "speed": "speeds",
    "told_speed": "speeds commanded",
    "told_heading": "headings commanded",
}

_Part = dict[str, list[tuple[float, float]]]


class Streams:
    """Values by what they are, each with its time.

    Args:
        name: of the log.
        tell: is told what is left out.
    """

    def __init__(self, name: str, tell: Tell) -> None:
        self.name, self._tell = name, tell
        self._parts: list[_Part] = [{what: [] for what in NEEDED}]
        self._latest_s = -math.inf

    def clock(self, time_s: float) -> None:
        """Note the time at which the log was gone on with; a clock that was set back begins a new part."""
        if time_s < self._latest_s - SET_BACK_S:
            self._tell(f"{self.name}: its clock was set back by {self._latest_s - time_s:.1f} s; cut there")
            self._parts.append({what: [] for what in NEEDED})
            self._latest_s = time_s
        self._latest_s = max(self._latest_s, time_s)

    def add(self, what: str, time_s: float, value: float) -> None:
        """Note a value; one that is not finite or not known says nothing, as a command it ends the one before."""
        known = math.isfinite(value) and not (what == "heading" and round(value, 2) in UNKNOWN_HEADINGS)
        if known or what.startswith("told"):
            self._parts[-1][what].append((time_s, value if known else math.nan))

    def add_velocity_told(self, time_s: float, east_mps: float, north_mps: float) -> None:
        """Note a command given as a velocity: its direction and its size."""
        self.add("told_heading", time_s, math.degrees(math.atan2(east_mps, north_mps)))
        self.add("told_speed", time_s, math.hypot(east_mps, north_mps))

    def runs(self, names: Mapping[str, str], holds_s: float = SPENT_S, sampled: bool = False) -> list[Run]:
        """Put the values together to runs, see `consistency`.

        Args:
            names: message names that would have told each of `NEEDED`, for the words of an error.
            holds_s: how long a command is in force, s.
            sampled: whether commands were written down at times of the log's own instead of when they were given.

        Raises:
            FitError: something is never told, comes too seldom, or contradicts the rest.
        """
        missing = [what for what in NEEDED if not any(part[what] for part in self._parts)]
        if missing:
            words = dict.fromkeys(f"{NEEDED[what]} ({names[what]})" for what in missing)
            raise FitError(f"{self.name} tells no {', no '.join(words)}; give a log in which the boat was commanded")
        parts = [{what: _sorted(values) for what, values in part.items()} for part in self._parts if all(part.values())]
        self._check_rates(parts, sampled)
        return consistent(self.name, [run for part in parts for run in self._on_grid(part, holds_s)], self._tell)

    def _check_rates(self, parts: Sequence[Mapping[str, Array]], sampled: bool) -> None:
        for what in ("x", "told_speed") if sampled else ("x",):
            gaps = [np.diff(part[what][0]) for part in parts]
            every_s = float(np.median(np.concatenate(gaps))) if sum(map(len, gaps)) else 0.0
            most_s = SELDOM_S if what == "told_speed" else SPENT_S
            if every_s > most_s + SAME_S:
                raise FitError(
                    f"{self.name}: {NEEDED[what]} come every {every_s:.2g} s, from which no delay can be told; "
                    f"log them at least every {most_s:g} s"
                )

    def _on_grid(self, part: Mapping[str, Array], holds_s: float) -> list[Run]:
        """Runs of a part: the grid, cut wherever something is not known."""
        runs, times = [], part["x"][0]
        gaps = np.flatnonzero(np.diff(times) > SPENT_S + SAME_S) + 1
        for begin, end in pairwise([0, *gaps.tolist(), len(times)]):
            first_s, last_s = times[begin], times[end - 1]
            grid = first_s + STEP_S * np.arange(int((last_s - first_s) / STEP_S + SAME_S) + 1)
            seen = np.column_stack([_between(part[what], grid, what) for what in ("x", "y", "heading", "speed")])
            told = np.column_stack([_held(part[what], grid, holds_s) for what in ("told_speed", "told_heading")])
            fine = np.isfinite(seen).all(axis=1) & np.isfinite(told).all(axis=1)
            edges = np.flatnonzero(np.diff(np.concatenate([[False], fine, [False]])))
            for a, b in zip(edges[::2], edges[1::2], strict=True):
                if (b - a) * STEP_S >= SHORTEST_S:
                    runs.append(Run.of(self.name, float(grid[a]), seen[a:b], told[a:b]))
        return runs


def _sorted(values: Sequence[tuple[float, float]]) -> Array:
    """Times and values (2, k) in the order of the times, the first of any that are the same."""
    pairs = np.array(values)[np.argsort([time_s for time_s, _ in values], kind="stable")]
    return np.asarray(pairs[np.concatenate([[True], np.diff(pairs[:, 0]) > 1e-6])].T)


def _between(stream: Array, times: Array, what: str) -> Array:
    """Values between those told, NaN more than `SPENT_S` from any."""
    values = np.unwrap(stream[1], period=360.0) if what == "heading" else stream[1]
    after = np.clip(np.searchsorted(stream[0], times), 0, len(stream[0]) - 1)
    apart = np.minimum(np.abs(stream[0][after] - times), np.abs(stream[0][np.maximum(after - 1, 0)] - times))
    return np.where(apart <= SPENT_S, np.interp(times, stream[0], values), np.nan)


def _held(stream: Array, times: Array, holds_s: float) -> Array:
    """The last value told before each time, NaN where that is too long ago."""
    last = np.searchsorted(stream[0], times + SAME_S, side="right") - 1
    known = (last >= 0) & (times - stream[0][np.maximum(last, 0)] <= holds_s)
    return np.where(known, stream[1][np.maximum(last, 0)], np.nan)
