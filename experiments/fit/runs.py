"""`Run`: a stretch of a log that agrees with itself, in which a boat was commanded, on a grid of equal steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from ..words import count_text

STEP_S = 0.1  # step of the grid and of the model, s
SHORTEST_S = 3.0  # shorter runs show nothing
RATE_STEPS = 2  # turn rates are taken over so many steps
FASTEST_MPS = 40.0
JUMP_M, JUMP_SHARE = 1.5, 1.5
"""A position that moves farther in a step than so many metres and so many times the top speed's way has jumped."""
WINDOW_STEPS = 20  # ways are compared over so many steps
CHUNK_S, LEAST_WAY_M = 12.0, 5.0
"""A log is judged in stretches of about this length, s, in which the boat made at least this way."""
MOST_BAD = 0.5  # a log of which more than this share, by time under way, contradicts itself is refused as a whole
WAY_RATIO = (0.65, 1.55)  # the way by speeds over the way by positions: a current explains no more than this
OFF_DEG = 30.0  # median angle from heading to course beyond which a heading is another quantity, deg
UNITS = {"knots": 1.944, "mph": 2.237, "ft/s": 3.281, "km/h": 3.6, "cm/s": 100.0}  # speeds of 1 m/s in other units
SPENT_S = 1.0
"""A command not repeated for this long is no longer in force, s; a run ends where nothing was seen for so long."""
SET_BACK_S = 0.2
"""A log whose time falls by more than this had its clock set back, s; less is the order in which messages came."""
SELDOM_S = 0.25  # commands that were only looked at every so many seconds or less often show no delay
SAME_S = 1e-4  # times closer together are the same, s
UNKNOWN_HEADINGS = (655.35, 65535.0)  # what MAVLink writes for a heading that is not known, deg
SEEN, COMMANDED = ("x", "y", "heading", "speed"), ("commanded_speed", "commanded_heading")
WORDS = ("positions", "positions", "headings", "speeds", "speeds commanded", "headings commanded")
NEEDED = dict(zip((*SEEN, *COMMANDED), WORDS, strict=True))

Notice = Callable[[str], None]  # gets a sentence about what of a log is left out, and why


def silent(words: str) -> None:
    """Drop the notice."""


class FitError(ConfigError):
    """A log cannot be read, contradicts itself, or says too little of the boat; one line that names the remedy."""


def spans(mask: Any) -> list[tuple[int, int]]:
    """Begin and end of each stretch in which a mask holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


@dataclass(frozen=True)
class Run:
    """One run of k steps."""

    name: str  # of the log it is from
    begin_s: float  # time of its first step in the log, s
    # (k, 5) x m, y m, heading deg (unwrapped, clockwise from the y axis), speed m/s, turn rate deg/s
    seen: Array = field(repr=False)
    commanded: Array = field(repr=False)  # (k, 2) speed m/s and heading deg (unwrapped) commanded at each step

    @classmethod
    def of(cls, name: str, begin_s: float, seen: Array, commanded: Array) -> Run:
        """Build a run of x, y, heading, speed (k, 4) and of speed and heading commanded (k, 2), on the grid."""
        heading, course = np.unwrap(seen[:, 2], period=360.0), np.unwrap(commanded[:, 1], period=360.0)
        course = course + 360.0 * np.round((heading[0] - course[0]) / 360.0)
        padded = np.concatenate([np.full(RATE_STEPS, heading[0]), heading])
        rates = (padded[RATE_STEPS:] - padded[:-RATE_STEPS]) / (RATE_STEPS * STEP_S)
        whole = np.column_stack([seen[:, :2], heading, seen[:, 3], rates])
        return cls(name, begin_s, whole, np.column_stack([commanded[:, 0], course]))

    def part(self, begin: int, end: int) -> Run:
        """Take steps ``begin`` to ``end``, the last one left out."""
        return Run(self.name, self.begin_s + begin * STEP_S, self.seen[begin:end], self.commanded[begin:end])

    def parts(self, bounds: Sequence[tuple[int, int]]) -> list[Run]:
        """Those of some parts that are long enough to show something."""
        return [self.part(a, b) for a, b in bounds if (b - a) * STEP_S >= SHORTEST_S]

    def bounds(self, length_s: float) -> list[tuple[int, int]]:
        """Begin and end of equal parts of about that length."""
        count = max(1, round(self.seconds / length_s))
        return list(pairwise(np.linspace(0, len(self.seen), count + 1).astype(int).tolist()))

    @property
    def seconds(self) -> float:
        """How long it is, s."""
        return len(self.seen) * STEP_S

    @property
    def kind(self) -> str:
        """What it shows most of: "turn", "faster", "slower" or "steady"."""
        turned = float(np.ptp(self.commanded[:, 1])) + float(np.abs(self.commanded[0, 1] - self.seen[0, 2]))
        gain = float(self.seen[-1, 3] - self.seen[0, 3])
        if turned > 10.0:
            return "turn"
        return "steady" if abs(gain) < 0.3 else "faster" if gain > 0.0 else "slower"


def consistent(name: str, runs: Sequence[Run], notice: Notice) -> list[Run]:
    """Cut out of a log's runs what contradicts the rest, with a notice; `FitError` where all of it does."""
    top_mps = max((float(np.abs(run.seen[:, 3]).max()) for run in runs), default=0.0)
    if top_mps > FASTEST_MPS:
        raise FitError(f"{name}: a speed of {top_mps:.0f} m/s is no boat's; give speeds in m/s")
    pieces = [piece for run in runs for piece in _without_jumps(run, top_mps, notice)]
    chunks = [(n, a, b) for n, piece in enumerate(pieces) for a, b in piece.bounds(CHUNK_S)]
    ways = [_ways(pieces[n].part(a, b)) for n, a, b in chunks]
    faults = [_contradiction(way) for way in ways]
    steps = np.array([b - a for _, a, b in chunks])
    bad = [k for k, fault in enumerate(faults) if fault]
    if bad and steps[bad].sum() > MOST_BAD * steps[[_moves(way) for way in ways]].sum():
        raise FitError(f"{name}: {_contradiction(np.concatenate([ways[k] for k in bad], axis=1)) or faults[bad[0]]}")
    fine = [np.ones(len(piece.seen), dtype=bool) for piece in pieces]
    for k in bad:
        n, a, b = chunks[k]
        fine[n][a:b] = False
        begin_s = pieces[n].begin_s + a * STEP_S
        notice(f"{name}: {(b - a) * STEP_S:.0f} s from {begin_s:.1f} s on are left out: {faults[k]}")
    return [part for piece, mask in zip(pieces, fine, strict=True) for part in piece.parts(spans(mask))]


def _without_jumps(run: Run, top_mps: float, notice: Notice) -> list[Run]:
    """The run, cut wherever its position jumps."""
    steps = np.hypot(*np.diff(run.seen[:, :2], axis=0).T)
    jumping = spans(steps > JUMP_M + JUMP_SHARE * top_mps * STEP_S)
    if not jumping:
        return [run]
    far_m = max(float(np.hypot(*(run.seen[b, :2] - run.seen[a, :2]))) for a, b in jumping)
    first_s = run.begin_s + jumping[0][0] * STEP_S
    words = f"first at {first_s:.1f} s, by {far_m:.0f} m at most; cut there"
    notice(f"{run.name}: its position jumps {count_text(len(jumping), 'time')}, {words}")
    cuts = [k for a, b in jumping for k in range(a + 1, b + 1)]
    return run.parts(list(pairwise([0, *cuts, len(run.seen)])))


def _ways(run: Run) -> Array:
    """Ways made in each window (2, windows, 2), m east and north: by positions, and by speeds along headings."""
    heading = np.radians(run.seen[:-1, 2])
    moved = STEP_S * run.seen[:-1, 3, None] * np.column_stack([np.sin(heading), np.cos(heading)])
    reckoned = np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    return np.stack([np.diff(places[::WINDOW_STEPS], axis=0) for places in (run.seen[:, :2], reckoned)])


def _moves(ways: Array) -> bool:
    """Whether ways are long enough to be compared."""
    return bool(np.hypot(ways[..., 0], ways[..., 1]).sum(axis=1).max() >= LEAST_WAY_M)


def _contradiction(ways: Array) -> str:
    """What is wrong with ways made (2, windows, 2), in words; empty: nothing."""
    if not _moves(ways):
        return ""
    by_positions, by_speeds = np.hypot(ways[..., 0], ways[..., 1])
    by_positions_m, by_speeds_m = float(by_positions.sum()), float(by_speeds.sum())
    ratio = by_speeds_m / max(by_positions_m, 1e-9)
    if not WAY_RATIO[0] <= ratio <= WAY_RATIO[1]:
        off, unit = min((abs(ratio / size - 1.0), unit) for unit, size in UNITS.items())
        unit = f" (they look like {unit})" if off < 0.1 else ""
        went = f"by its speeds the boat went {by_speeds_m:.0f} m, by its positions {by_positions_m:.0f} m"
        return f"{went}; give speeds in m/s{unit} and positions in m"
    going = np.minimum(by_positions, by_speeds) > 0.5 * float(np.median(by_speeds[by_speeds > 0.0]))
    courses = np.arctan2(ways[..., 0], ways[..., 1])[:, going]
    off_deg = np.degrees(np.abs(np.angle(np.exp(1j * (courses[0] - courses[1])))))
    if len(off_deg) and float(np.median(off_deg)) > OFF_DEG:
        return (
            f"its headings are {np.median(off_deg):.0f} deg off the course that its positions make, half of the time; "
            "give headings in degrees clockwise from north (from the y axis)"
        )
    return ""


class Streams:
    """Values of a log by what they are, each with its time.

    Args:
        name: of the log.
        notice: gets a sentence about what is left out.
    """

    def __init__(self, name: str, notice: Notice) -> None:
        self.name, self._notice = name, notice
        self._parts: list[dict[str, list[tuple[float, float]]]] = [{what: [] for what in NEEDED}]
        self._latest_s = -math.inf

    def clock(self, time_s: float) -> None:
        """Note the time at which the log was gone on with; a clock that was set back begins a new part."""
        if time_s < self._latest_s - SET_BACK_S:
            self._notice(f"{self.name}: its clock was set back by {self._latest_s - time_s:.1f} s; cut there")
            self._parts.append({what: [] for what in NEEDED})
            self._latest_s = time_s
        self._latest_s = max(self._latest_s, time_s)

    def add(self, what: str, time_s: float, value: float) -> None:
        """Note a value; one that is not finite or not known says nothing, as a command it ends the one before."""
        known = math.isfinite(value) and not (what == "heading" and round(value, 2) in UNKNOWN_HEADINGS)
        if known or what in COMMANDED:
            self._parts[-1][what].append((time_s, value if known else math.nan))

    def add_all(self, time_s: float, **values: float) -> None:
        """Note several values of one time."""
        for what, value in values.items():
            self.add(what, time_s, value)

    def runs(self, names: Mapping[str, str], holds_s: float = SPENT_S, sampled: bool = False) -> list[Run]:
        """Put the values together to runs that do not contradict themselves.

        Args:
            names: the messages that carry each of `NEEDED`, for the words of an error.
            holds_s: how long a command is in force, s.
            sampled: whether commands were written down at times of the log's own instead of when they were given.

        Raises:
            FitError: something is never logged, comes too seldom, or contradicts the rest.
        """
        missing = [what for what in NEEDED if not any(part[what] for part in self._parts)]
        if missing:
            words = dict.fromkeys(f"{NEEDED[what]} ({names[what]})" for what in missing)
            raise FitError(f"{self.name} tells no {', no '.join(words)}; give a log in which the boat was commanded")
        parts = [{what: _sorted(values) for what, values in part.items()} for part in self._parts if all(part.values())]
        for what, most_s in (("x", SPENT_S), *((("commanded_speed", SELDOM_S),) if sampled else ())):
            gaps = [gap for part in parts for gap in np.diff(part[what][0]).tolist()]
            every_s = float(np.median(gaps)) if gaps else 0.0
            if every_s > most_s + SAME_S:
                raise FitError(
                    f"{self.name}: {NEEDED[what]} come every {every_s:.2g} s, from which no delay can be found; "
                    f"log them at least every {most_s:g} s"
                )
        return consistent(self.name, [run for part in parts for run in self._on_grid(part, holds_s)], self._notice)

    def _on_grid(self, part: Mapping[str, Array], holds_s: float) -> list[Run]:
        """Runs of a part: the grid, cut wherever something is not known."""
        runs, times = [], part["x"][0]
        gaps = np.flatnonzero(np.diff(times) > SPENT_S + SAME_S) + 1
        for begin, end in pairwise([0, *gaps.tolist(), len(times)]):
            first_s, last_s = times[begin], times[end - 1]
            grid = first_s + STEP_S * np.arange(int((last_s - first_s) / STEP_S + SAME_S) + 1)
            seen = np.column_stack([_between(part[what], grid, what) for what in SEEN])
            commanded = np.column_stack([_held(part[what], grid, holds_s) for what in COMMANDED])
            for a, b in spans(np.isfinite(seen).all(axis=1) & np.isfinite(commanded).all(axis=1)):
                if (b - a) * STEP_S >= SHORTEST_S:
                    runs.append(Run.of(self.name, float(grid[a]), seen[a:b], commanded[a:b]))
        return runs


def _sorted(values: Sequence[tuple[float, float]]) -> Array:
    """Times and values (2, k) in the order of the times, the first of any that are the same."""
    pairs = np.array(values)[np.argsort([time_s for time_s, _ in values], kind="stable")]
    return np.asarray(pairs[np.concatenate([[True], np.diff(pairs[:, 0]) > 1e-6])].T)


def _between(stream: Array, times: Array, what: str) -> Array:
    """Values between those given, NaN more than `SPENT_S` from any."""
    values = np.unwrap(stream[1], period=360.0) if what == "heading" else stream[1]
    after = np.clip(np.searchsorted(stream[0], times), 0, len(stream[0]) - 1)
    apart = np.minimum(np.abs(stream[0][after] - times), np.abs(stream[0][np.maximum(after - 1, 0)] - times))
    return np.where(apart <= SPENT_S, np.interp(times, stream[0], values), np.nan)


def _held(stream: Array, times: Array, holds_s: float) -> Array:
    """The last value given before each time, NaN where that is too long ago."""
    last = np.searchsorted(stream[0], times + SAME_S, side="right") - 1
    known = (last >= 0) & (times - stream[0][np.maximum(last, 0)] <= holds_s)
    return np.where(known, stream[1][np.maximum(last, 0)], np.nan)
