"""Judging one boat's side of a breach.

Looking back from the breach, own commands may begin to differ at any step of the last T seconds at which the pair is
apart. The tracks of all others stay as they were. The breach is avoidable when, from one of those steps on, some
sequence of commands keeps the radius from every boat until the pair was apart again, and a settle time longer. A third
boat that is inside the radius when the commands begin is another breach, already under way: it is left out until it
was apart in the record, and kept clear of from then on.

Between two steps with no entry in between, whoever can still avoid from the later one can also avoid from the earlier
one, by following the recorded track. So the latest such step is found by growing leads and bisection.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .boat import Array
from .checks import checked
from .errors import OracleError
from .model import replay, turned
from .search import commands_of, search
from .settings import Level, Settings
from .verdict import Outcome, Plan, Verdict

ROUNDING_M = 1e-9
"""Kept above the radius, so that a plan replayed with other rounding is still clear."""
FAR_M = 1e9
"""Where boats are that need not be kept clear of, m."""
DEFAULT = Settings()


def judge(
    states: Any,
    boats: Any,
    own: int,
    step: int,
    radius_m: float,
    dt_s: float = 0.1,
    other: int | None = None,
    settings: Settings = DEFAULT,
) -> Verdict:
    """Decide whether a boat could have avoided a breach.

    Args:
        states: (T+1, n, 11) state rows of all boats; index k after k steps.
        boats: parameters of the n boats: `Boat`s or the simulator's rows (n, 38).
        own: index of the boat that is judged.
        step: index of the first state inside the radius.
        radius_m: separation radius, m; at exactly the radius is inside.
        dt_s: length of a step.
        other: the boat it came too close to; the nearest at ``step`` when left out.
        settings: how far to look and how finely to search.

    Raises:
        OracleError: the record, boats or numbers cannot be judged, or there is no breach at ``step``.
    """
    case = checked(states, boats, own, step, radius_m, dt_s, other)
    gaps = np.hypot(*np.moveaxis(case.tracks - case.states[:, None, own, :2], -1, 0))
    end = _end_of(gaps[:, case.partner], case.radius_m, step, settings, dt_s)
    first = max(0, step - round(settings.look_back_s / dt_s))
    inside = gaps <= case.radius_m + ROUNDING_M
    asked = _Question(
        case.states[:, own], case.numbers, case.tracks, inside, end, case.radius_m, dt_s, case.top_mps, settings
    )
    facts = {"own": own, "other": case.other, "step": step, "radius_m": case.radius_m, "end_step": end}
    facts["looked_back_s"] = (step - first) * dt_s
    if inside[:step, case.partner].all():
        return Verdict(**facts, outcome=Outcome.STARTED_INSIDE, **_nothing(True, 0))
    for low, high in reversed(_runs(inside[first:step], case.partner, first)):
        latest, exhausted = _latest(asked, low, high)
        if latest is not None:
            return _avoidable(asked, facts, latest, exhausted)
    return Verdict(**facts, outcome=Outcome.UNAVOIDABLE, **_nothing(asked.exhausted, asked.searches))


@dataclass
class _Question:
    """Can the boat keep clear from a given step on? Answers are searched, and proved by replay."""

    rows: Array
    numbers: Array
    tracks: Array
    inside: NDArray[np.bool_]
    end: int
    radius_m: float
    dt_s: float
    top_mps: float
    settings: Settings
    searches: int = 0
    plans: dict[int, Plan] = field(default_factory=dict)
    failures: dict[tuple[int, Level], bool] = field(default_factory=dict)

    def answer(self, begin: int, level: Level) -> bool:
        """Search from state ``begin``; a plan found is kept."""
        if begin in self.plans:
            return True
        if (begin, level) in self.failures:
            return False
        self.searches += 1
        start, others = self.rows[begin].copy(), self._reachable(begin)
        lengths = _lengths(level.first_s, self.end - begin, self.dt_s)
        rudders, actions = np.array(sorted(level.rudders)), np.zeros(lengths.size, dtype=np.int64)
        sizes = np.array([level.position_m, level.position_m, level.heading_deg, level.speed_mps, level.thrust])
        limit_m = self.radius_m + ROUNDING_M
        found, whole = search(
            self.numbers, start, others, limit_m, self.dt_s, lengths, rudders, sizes, level.width, actions
        )
        if not found:
            self.failures[begin, level] = whole
            return False
        commands = np.empty((self.end - begin, 2))
        commands_of(self.numbers, start, actions, lengths, rudders, self.dt_s, commands)
        self._prove(begin, commands)
        return True

    @property
    def exhausted(self) -> bool:
        """Whether the full searches that failed dropped no state."""
        return all(whole for (_, level), whole in self.failures.items() if level == self.settings.full)

    def _tracks(self, begin: int) -> Array:
        """Tracks from ``begin`` on; a boat that is inside at that step is far away until it was apart."""
        tracks = self.tracks[begin : self.end + 1].copy()
        tracks[np.logical_and.accumulate(self.inside[begin : self.end + 1], axis=0)] = FAR_M
        return tracks

    def _reachable(self, begin: int) -> Array:
        """Of those tracks the ones that the own boat could come near at all."""
        tracks = self._tracks(begin)
        start = self.rows[begin]
        reach = self.radius_m + 1.0 + self.dt_s * max(self.top_mps, start[3]) * np.arange(len(tracks))
        gaps = np.hypot(*np.moveaxis(tracks - start[:2], -1, 0))
        return np.ascontiguousarray(tracks[:, (gaps <= reach[:, None]).any(axis=0)])

    def _prove(self, begin: int, commands: Array) -> None:
        """Replay the commands against all boats; a plan counts only when that, too, stays clear."""
        path = np.empty((len(commands) + 1, 2))
        others = self._tracks(begin)
        headings = np.empty(len(commands))
        closest_m = replay(self.numbers, self.rows[begin], commands, others, self.dt_s, path, headings)
        if not closest_m > self.radius_m:
            raise OracleError(f"the plan from step {begin} does not hold in the replay; report the record")
        absolute = np.array([turned(h, e) for h, e in zip(headings, commands[:, 1], strict=True)])
        self.plans[begin] = Plan(begin, commands[:, 0], commands[:, 1], absolute, path, closest_m)


def _latest(asked: _Question, low: int, high: int) -> tuple[int | None, bool]:
    """Find the latest step of [low, high] from which the breach can be avoided.

    Returns:
        The step, None when there is none; whether the search that failed after it was exhausted.
    """
    best, failed = _bracket(asked, low, high, asked.settings.quick, growth=2)
    if best is None:
        best, failed = _bracket(asked, low, high, asked.settings.full, growth=4)
        if best is None:
            return None, asked.exhausted
    else:
        best, failed = _bisect(asked, best, failed, asked.settings.quick)
        best, failed = _press_on(asked, best, high)
    best, failed = _bisect(asked, best, failed, asked.settings.full)
    if failed > high:
        return best, True
    return best, asked.failures[failed, asked.settings.full]


def _bracket(asked: _Question, low: int, high: int, level: Level, growth: int) -> tuple[int | None, int]:
    """Multiply the lead until a search succeeds: the step it began at, and the latest one tried before."""
    failed, lead = high + 1, 0
    while True:
        begin = max(low, high - lead)
        if asked.answer(begin, level):
            return begin, failed
        if begin == low:
            return None, low
        failed, lead = begin, growth * lead + growth - 1


def _press_on(asked: _Question, best: int, high: int) -> tuple[int, int]:
    """From a success of the quick search go later with the full one, in growing strides, until it fails."""
    stride = 1
    while best < high:
        begin = min(high, best + stride)
        if not asked.answer(begin, asked.settings.full):
            return best, begin
        best, stride = begin, 2 * stride
    return best, high + 1


def _bisect(asked: _Question, best: int, failed: int, level: Level) -> tuple[int, int]:
    while failed - best > 1:
        middle = (best + failed) // 2
        if asked.answer(middle, level):
            best = middle
        else:
            failed = middle
    return best, failed


def _avoidable(asked: _Question, facts: dict[str, Any], latest: int, exhausted: bool) -> Verdict:
    return Verdict(
        **facts,
        outcome=Outcome.AVOIDABLE,
        last_step=latest,
        last_preventable_s=(facts["step"] - latest) * asked.dt_s,
        plan=asked.plans[latest],
        exhausted=exhausted,
        searches=asked.searches,
    )


def _nothing(exhausted: bool, searches: int) -> dict[str, Any]:
    return {
        "last_step": None,
        "last_preventable_s": None,
        "plan": None,
        "exhausted": exhausted,
        "searches": searches,
    }


def _end_of(gap_m: Array, radius_m: float, step: int, settings: Settings, dt_s: float) -> int:
    """Index of the last state that counts: the breach's last, and the settle time, within the record."""
    longest = step + round(settings.longest_s / dt_s)
    apart = np.flatnonzero(gap_m[step : longest + 1] > radius_m)
    over = step + int(apart[0]) if apart.size else longest
    return min(len(gap_m) - 1, over + round(settings.settle_s / dt_s))


def _runs(inside: NDArray[np.bool_], partner: int, first: int) -> list[tuple[int, int]]:
    """Stretches of steps with the pair apart and no other boat entering, as (first, last) indices of the record.

    Args:
        inside: (steps, m) whether each boat is within the radius.
        partner: column of the boat the breach is with.
        first: index of the first of these steps in the record.
    """
    entered = np.zeros(len(inside), dtype=np.bool_)
    entered[1:] = (inside[1:] & ~inside[:-1]).any(axis=1)
    runs: list[tuple[int, int]] = []
    for k in np.flatnonzero(~inside[:, partner]) + first:
        if runs and runs[-1][1] == k - 1 and not entered[k - first]:
            runs[-1] = (runs[-1][0], int(k))
        else:
            runs.append((int(k), int(k)))
    return runs


def _lengths(first_s: tuple[float, ...], steps: int, dt_s: float) -> NDArray[np.int64]:
    """Split a number of steps into choices: the first lengths as given, then the last one over and over."""
    lengths: list[int] = []
    left = steps
    while left > 0:
        wanted_s = first_s[min(len(lengths), len(first_s) - 1)]
        lengths.append(min(left, max(1, round(wanted_s / dt_s))))
        left -= lengths[-1]
    return np.array(lengths, dtype=np.int64)
