"""`Run`: a stretch of a log that agrees with itself, in which a boat was told where to go, on a grid of equal steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

STEP_S = 0.1
"""Step of the grid and of the model, s."""
SHORTEST_S = 3.0
"""Shorter runs tell nothing."""
RATE_OVER_S = 0.2
"""Turn rates are taken over this time, s."""


class FitError(ConfigError):
    """A log cannot be read, contradicts itself, or says too little of the boat; one line that names the remedy."""


@dataclass(frozen=True)
class Run:
    """One run of k steps.

    Attributes:
        name: of the log it is from.
        begin_s: time of its first step in the log, s.
        seen: (k, 5) x m, y m, heading deg (unwrapped, clockwise from the y axis), speed m/s, turn rate deg/s.
        told: (k, 2) speed m/s and heading deg (unwrapped) commanded at each step.
    """

    name: str
    begin_s: float
    seen: Array = field(repr=False)
    told: Array = field(repr=False)

    @classmethod
    def of(cls, name: str, begin_s: float, seen: Array, told: Array) -> Run:
        """Build a run of x, y, heading, speed (k, 4) and of speed and heading told (k, 2), on the grid."""
        heading, wanted = np.unwrap(seen[:, 2], period=360.0), np.unwrap(told[:, 1], period=360.0)
        wanted = wanted + 360.0 * np.round((heading[0] - wanted[0]) / 360.0)
        back = max(1, round(RATE_OVER_S / STEP_S))
        padded = np.concatenate([np.full(back, heading[0]), heading])
        rates = (padded[back:] - padded[:-back]) / (back * STEP_S)
        whole = np.column_stack([seen[:, 0], seen[:, 1], heading, seen[:, 3], rates])
        return cls(name, begin_s, whole, np.column_stack([told[:, 0], wanted]))

    def part(self, begin: int, end: int) -> Run:
        """Take steps ``begin`` to ``end``, the last one left out."""
        return Run(self.name, self.begin_s + begin * STEP_S, self.seen[begin:end], self.told[begin:end])

    @property
    def seconds(self) -> float:
        """How long it is, s."""
        return len(self.seen) * STEP_S

    @property
    def kind(self) -> str:
        """What it shows most of: "turn", "faster", "slower" or "steady"."""
        turned = float(np.ptp(self.told[:, 1])) + float(np.abs(self.told[0, 1] - self.seen[0, 2]))
        if turned > 10.0:
            return "turn"
        gain = float(self.seen[-1, 3] - self.seen[0, 3])
        if abs(gain) < 0.3:
            return "steady"
        return "faster" if gain > 0.0 else "slower"


FASTEST_MPS = 40.0
JUMP_M, JUMP_SHARE = 1.5, 1.5
"""A position that moves farther in a step than so many metres and so many times the top speed's way has jumped."""
WINDOW_STEPS = 20
"""Ways are compared over so many steps."""
CHUNK_S = 12.0
"""A log is judged in stretches of about this length, s."""
LEAST_WAY_M = 5.0
"""Shorter ways of a stretch are not compared."""
MOST_BAD = 0.5
"""A log of which more than this share, by time under way, contradicts itself is refused as a whole."""
WAY_RATIO = (0.65, 1.55)
"""The way by speeds over the way by positions: a current explains no more than this."""
OFF_DEG = 30.0
"""Median angle from heading to course beyond which a heading is another quantity, deg."""
UNITS = {"knots": 1.944, "mph": 2.237, "ft/s": 3.281, "km/h": 3.6, "cm/s": 100.0}
"""Speeds of 1 m/s in other units."""


def consistent(name: str, runs: Sequence[Run], tell: Callable[[str], None]) -> list[Run]:
    """Cut out what contradicts the rest.

    Args:
        name: of the log.
        runs: of it.
        tell: is told what is cut out.

    Raises:
        FitError: the log contradicts itself as a whole.
    """
    top_mps = max((float(np.abs(run.seen[:, 3]).max()) for run in runs), default=0.0)
    if top_mps > FASTEST_MPS:
        raise FitError(f"{name}: a speed of {top_mps:.0f} m/s is no boat's; give speeds in m/s")
    pieces = [piece for run in runs for piece in _without_jumps(run, top_mps, tell)]
    chunks = [chunk for piece in pieces for chunk in _chunks(piece)]
    ways = [_ways(chunk) for chunk in chunks]
    faults = [_contradiction(way) for way in ways]
    moving_s = sum(chunk.seconds for chunk, way in zip(chunks, ways, strict=True) if _moves(way))
    bad = [n for n, fault in enumerate(faults) if fault]
    if bad and sum(chunks[n].seconds for n in bad) > MOST_BAD * moving_s:
        raise FitError(f"{name}: {_contradiction(np.concatenate([ways[n] for n in bad], axis=1)) or faults[bad[0]]}")
    for n in bad:
        tell(f"{name}: {chunks[n].seconds:.0f} s from {chunks[n].begin_s:.1f} s on are left out: {faults[n]}")
    return [run for piece in pieces for run in _without(piece, [chunks[n] for n in bad])] if bad else pieces


def _chunks(run: Run) -> list[Run]:
    """Stretches of about `CHUNK_S`, each judged alone."""
    bounds = np.linspace(0, len(run.seen), max(1, round(run.seconds / CHUNK_S)) + 1).astype(int)
    return [run.part(a, b) for a, b in pairwise(bounds)]


def _without(run: Run, bad: Sequence[Run]) -> list[Run]:
    """What is left of a run without stretches of it."""
    fine = np.ones(len(run.seen), dtype=bool)
    for chunk in bad:
        begin = round((chunk.begin_s - run.begin_s) / STEP_S)
        if 0 <= begin < len(fine):
            fine[begin : begin + len(chunk.seen)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fine, [False]])))
    spans = zip(edges[::2], edges[1::2], strict=True)
    return [run.part(a, b) for a, b in spans if (b - a) * STEP_S >= SHORTEST_S]


def _without_jumps(run: Run, top_mps: float, tell: Callable[[str], None]) -> list[Run]:
    """The run, cut wherever its position jumps."""
    steps = np.hypot(*np.diff(run.seen[:, :2], axis=0).T)
    jumps = np.flatnonzero(steps > JUMP_M + JUMP_SHARE * top_mps * STEP_S)
    if len(jumps) == 0:
        return [run]
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > 1) + 1)
    far_m = max(float(np.hypot(*(run.seen[group[-1] + 1, :2] - run.seen[group[0], :2]))) for group in groups)
    tell(
        f"{run.name}: its position jumps {len(groups)} times, first at {run.begin_s + jumps[0] * STEP_S:.1f} s, "
        f"by {far_m:.0f} m at most; cut there"
    )
    bounds = [0, *(int(jump) + 1 for jump in jumps), len(run.seen)]
    return [run.part(a, b) for a, b in pairwise(bounds) if (b - a) * STEP_S >= SHORTEST_S]


def _ways(run: Run) -> Array:
    """Ways made in each window (2, windows, 2), m east and north: by positions, and by speeds along headings."""
    at = np.arange(0, len(run.seen), WINDOW_STEPS)
    heading = np.radians(run.seen[:-1, 2])
    moved = STEP_S * run.seen[:-1, 3, None] * np.column_stack([np.sin(heading), np.cos(heading)])
    reckoned = np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    return np.stack([np.diff(run.seen[at, :2], axis=0), np.diff(reckoned[at], axis=0)])


def _moves(ways: Array) -> bool:
    """Whether ways are long enough to be compared."""
    return bool(np.hypot(ways[..., 0], ways[..., 1]).sum(axis=1).max() >= LEAST_WAY_M)


def _contradiction(ways: Array) -> str:
    """What is wrong with ways made (2, windows, 2), in words; empty: nothing."""
    if not _moves(ways):
        return ""
    by_positions, by_speeds = np.hypot(ways[..., 0], ways[..., 1])
    made, told = float(by_positions.sum()), float(by_speeds.sum())
    ratio = told / max(made, 1e-9)
    if not WAY_RATIO[0] <= ratio <= WAY_RATIO[1]:
        unit = min(UNITS, key=lambda unit: abs(ratio / UNITS[unit] - 1.0))
        unit = f" (they look like {unit})" if abs(ratio / UNITS[unit] - 1.0) < 0.1 else ""
        return (
            f"by its speeds the boat went {told:.0f} m, by its positions {made:.0f} m; "
            f"give speeds in m/s{unit} and positions in m"
        )
    going = np.minimum(by_positions, by_speeds) > 0.5 * float(np.median(by_speeds[by_speeds > 0.0]))
    courses = np.arctan2(ways[..., 0], ways[..., 1])[:, going]
    off = np.degrees(np.abs(np.angle(np.exp(1j * (courses[0] - courses[1])))))
    if len(off) and float(np.median(off)) > OFF_DEG:
        return (
            f"its headings are {np.median(off):.0f} deg off the course that its positions make, half of the time; "
            "give headings in degrees clockwise from north (from the y axis)"
        )
    return ""


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
