"""Judging a separation violation: could own commands have kept the radius, until when, and who let that pass?

Looking back from the breach, own commands may begin to differ at any step of the last T seconds at which the pair is
apart. The tracks of all others stay as they were. The breach is avoidable when, from one of those steps on, some
sequence of commands keeps the radius from every boat until the pair was apart again, and a settle time longer. A third
boat that is inside the radius when the commands begin is another breach, already under way: it is left out until it
was apart in the record, and kept clear of from then on.

Between two steps with no entry in between, whoever can still avoid from the later one can also avoid from the earlier
one, by following the recorded track. So the latest such step is found by growing leads and bisection.

A current carries all boats: in the frame of the water boats move by their own equations and distances are the same, so
that is where plans are searched. A late command changes nothing but the first state that it can change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .boat_model import MEMORY, N_STATE, Array, Boat, IntArray, as_boats, replay, turned
from .search import Task, commands_of, search
from .settings import AT_ONCE, DEFAULT, Level, Motion, Settings
from .verdict import BreachVerdict, OracleError, Outcome, Plan, Verdict, responsible_of

ROUNDING_M = 1e-9
"""Kept above the radius, so that a plan replayed with other rounding is still clear."""
FAR_M = 1e9
"""Where boats are that need not be kept clear of, m."""
Progress = Callable[[int, int], None]
"""Called with the number of breaches judged and the number there are."""


def judge(
    states: Any,
    boats: Any,
    own: int,
    step: int,
    radius_m: float,
    dt_s: float = 0.1,
    other: int | None = None,
    settings: Settings = DEFAULT,
    motion: Motion = AT_ONCE,
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
        motion: current and delay of the record.

    Raises:
        OracleError: the record, boats or numbers cannot be judged, or there is no breach at ``step``.
    """
    return _Record(states, boats, radius_m, dt_s, settings, motion).judge(own, step, other)


def judge_breach(
    states: Any, boats: Any, pair: tuple[int, int], step: int, radius_m: float, dt_s: float = 0.1, **rest: Any
) -> BreachVerdict:
    """Judge a breach from both sides; the rest is as for `judge_breaches`."""
    return judge_breaches(states, boats, [(step, *pair)], radius_m, dt_s, **rest)[0]


def judge_breaches(
    states: Any,
    boats: Any,
    breaches: Iterable[Any],
    radius_m: float,
    dt_s: float = 0.1,
    driven: Any = None,
    settings: Settings = DEFAULT,
    progress: Progress = lambda done, total: None,
    motion: Motion = AT_ONCE,
) -> list[BreachVerdict]:
    """Judge many breaches of one record, each from both sides.

    Args:
        states: see `judge`; as ``boats``, ``radius_m``, ``dt_s``, ``settings`` and ``motion``.
        boats: see `judge`.
        breaches: rows (step, boat a, boat b, ...); further columns are ignored.
        radius_m: separation radius, m.
        dt_s: length of a step, s.
        driven: (T, n) bool, whether the game drove the boat in step k -> k+1; None when it never did.
        settings: see `judge`.
        progress: called after each breach with the number judged and the number of all.
        motion: see `judge`.

    Raises:
        OracleError: see `judge`, or ``driven`` has another shape.
    """
    rows = [tuple(int(value) for value in row[:3]) for row in breaches]
    if not rows:
        return []
    record = _Record(states, boats, radius_m, dt_s, settings, motion)
    game, verdicts = _driven(driven, record.states.shape), []
    for done, (step, a, b) in enumerate(rows, start=1):
        first, second = record.judge(a, step, b), record.judge(b, step, a)
        verdicts.append(BreachVerdict(step, first, second, responsible_of(first, second, game)))
        progress(done, len(rows))
    return verdicts


def _driven(driven: Any, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    expected = (shape[0] - 1, shape[1])
    marks = np.zeros(expected, dtype=np.bool_) if driven is None else np.asarray(driven)
    if marks.shape != expected or marks.dtype != np.bool_:
        raise OracleError(
            f"driven is {marks.dtype} of shape {marks.shape}; give bool of shape {expected}, one row per step"
        )
    return marks


class _Record:
    """A run whose breaches are judged; arguments as those of `judge`, checked once.

    Raises:
        OracleError: the record, boats or numbers cannot be judged.
    """

    def __init__(
        self, states: Any, boats: Any, radius_m: float, dt_s: float, settings: Settings, motion: Motion
    ) -> None:
        self.states = _checked_states(states)
        for name, value in (("radius_m", radius_m), ("dt_s", dt_s)):
            if not (math.isfinite(value) and value > 0.0):
                raise OracleError(f"{name} is {value}; give a positive, finite number")
        self.boats: list[Boat] = as_boats(boats, self.states.shape[1])
        self.radius_m, self.dt_s, self.settings, self.motion = float(radius_m), dt_s, settings, motion

    def judge(self, own: int, step: int, other: int | None) -> Verdict:
        """One boat's side of a breach.

        Raises:
            OracleError: there is no such boat, or no breach at that step.
        """
        partner = self._partner(own, step, other)
        tracks = np.ascontiguousarray(np.delete(self.states[:, :, :2], own, axis=1))
        column = partner - (partner > own)
        gaps = np.hypot(*np.moveaxis(tracks - self.states[:, None, own, :2], -1, 0))
        end = self._end_of(gaps[:, column], step)
        first = max(0, step - round(self.settings.look_back_s / self.dt_s))
        delay = self.motion.delay_of(own, self.states.shape[1])
        changed = min(step, first + delay)  # the first state that the first command looked at changes
        inside = gaps <= self.radius_m + ROUNDING_M
        asked = self._question(own, tracks, inside, end)
        facts: dict[str, Any] = {"own": own, "other": partner, "step": step, "radius_m": self.radius_m, "end_step": end}
        facts |= {"looked_back_s": (step - first) * self.dt_s, "last_step": None, "last_preventable_s": None}
        facts |= {"plan": None}
        if inside[:step, column].all():
            return Verdict(**facts, outcome=Outcome.STARTED_INSIDE, exhausted=True, searches=0)
        for low, high in reversed(runs(inside[changed:step], column, changed)):
            latest, exhausted = _latest(asked, low, high)
            if latest is not None:
                plan, last = asked.plans[latest], latest - delay
                way = self.motion.way_m(latest + len(plan.path_m), self.dt_s)[latest:]
                facts |= {"last_step": last, "last_preventable_s": (step - last) * self.dt_s}
                facts |= {"plan": replace(plan, path_m=plan.path_m + way)}
                return Verdict(**facts, outcome=Outcome.AVOIDABLE, exhausted=exhausted, searches=asked.searches)
        return Verdict(**facts, outcome=Outcome.UNAVOIDABLE, exhausted=asked.exhausted, searches=asked.searches)

    def _partner(self, own: int, step: int, other: int | None) -> int:
        """The boat that the own one came too close to in that step."""
        steps, n = self.states.shape[0] - 1, self.states.shape[1]
        for boat in (own, *(() if other is None else (other,))):
            if not 0 <= boat < n:
                raise OracleError(f"there is no boat {boat}; the record's boats are 0..{n - 1}")
        if not 1 <= step <= steps:
            raise OracleError(f"there is no step {step} to judge; the record's steps are 1..{steps}")
        before, gaps = (np.hypot(*(self.states[k, :, :2] - self.states[k, own, :2]).T) for k in (step - 1, step))
        gaps[own] = np.inf
        partner = int(np.argmin(gaps)) if other is None else int(other)
        if not gaps[partner] <= self.radius_m:
            raise OracleError(
                f"boats {own} and {partner} are {gaps[partner]:.3f} m apart at step {step}, which is no breach of "
                f"{self.radius_m:g} m; give the first step inside the radius"
            )
        if step > 1 and before[partner] <= self.radius_m:
            raise OracleError(
                f"boats {own} and {partner} are inside already before step {step}; give the first step inside"
            )
        return partner

    def _end_of(self, gap_m: Array, step: int) -> int:
        """Index of the last state that counts: the breach's last, and the settle time, within the record."""
        longest = step + round(self.settings.longest_s / self.dt_s)
        apart = np.flatnonzero(gap_m[step : longest + 1] > self.radius_m)
        over = step + int(apart[0]) if apart.size else longest
        return min(len(gap_m) - 1, over + round(self.settings.settle_s / self.dt_s))

    def _question(self, own: int, tracks: Array, inside: NDArray[np.bool_], end: int) -> Question:
        """Ask in the frame of the water."""
        way, rows, boat = self.motion.way_m(len(self.states), self.dt_s), self.states[:, own].copy(), self.boats[own]
        rows[:, :2] -= way
        return Question(
            rows, boat, tracks - way[:, None], inside, end, self.radius_m, self.dt_s, self.settings, boat.numbers()
        )


def _checked_states(states: Any) -> Array:
    """The record's states as an array (T+1, n, 11).

    Raises:
        OracleError: another shape, a single boat or step, or numbers that are not finite.
    """
    try:
        table = np.ascontiguousarray(states, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OracleError(f"states must be numbers in one array (steps + 1, boats, {N_STATE}); got {error}") from error
    if table.ndim != 3 or table.shape[2] != N_STATE:
        raise OracleError(f"states have shape (steps + 1, boats, {N_STATE}); got {table.shape}")
    if table.shape[0] < 2 or table.shape[1] < 2:
        raise OracleError(f"a breach takes two boats and at least one step; the states have shape {table.shape}")
    plain = np.delete(table, MEMORY, axis=2)
    if not np.isfinite(plain).all() or np.isinf(table).any():
        k, boat = np.argwhere(~np.isfinite(plain).all(axis=2) | np.isinf(table).any(axis=2))[0]
        raise OracleError(f"the state of boat {boat} at step {k} is not finite; check the recorder or cut the record")
    return table


def runs(inside: NDArray[np.bool_], partner: int, first: int) -> list[tuple[int, int]]:
    """Stretches of steps with the pair apart and no other boat entering, as (first, last) indices of the record.

    Args:
        inside: (steps, m) whether each boat is within the radius.
        partner: column of the boat the breach is with.
        first: index of the first of these steps in the record.
    """
    entered = np.zeros(len(inside), dtype=np.bool_)
    entered[1:] = (inside[1:] & ~inside[:-1]).any(axis=1)
    found: list[tuple[int, int]] = []
    for k in np.flatnonzero(~inside[:, partner]) + first:
        if found and found[-1][1] == k - 1 and not entered[k - first]:
            found[-1] = (found[-1][0], int(k))
        else:
            found.append((int(k), int(k)))
    return found


def _latest(asked: Question, low: int, high: int) -> tuple[int | None, bool]:
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
    return best, failed > high or asked.failures[failed, asked.settings.full]


def _bracket(asked: Question, low: int, high: int, level: Level, growth: int) -> tuple[int | None, int]:
    """Multiply the lead until a search succeeds: the step it began at, and the latest one tried before."""
    failed, lead = high + 1, 0
    while True:
        begin = max(low, high - lead)
        if asked.answer(begin, level):
            return begin, failed
        if begin == low:
            return None, low
        failed, lead = begin, growth * lead + growth - 1


def _press_on(asked: Question, best: int, high: int) -> tuple[int, int]:
    """From a success of the quick search go later with the full one, in growing strides, until it fails."""
    stride = 1
    while best < high:
        begin = min(high, best + stride)
        if not asked.answer(begin, asked.settings.full):
            return best, begin
        best, stride = begin, 2 * stride
    return best, high + 1


def _bisect(asked: Question, best: int, failed: int, level: Level) -> tuple[int, int]:
    while failed - best > 1:
        middle = (best + failed) // 2
        if asked.answer(middle, level):
            best = middle
        else:
            failed = middle
    return best, failed


@dataclass
class Question:
    """Can a boat keep clear from a given step on? What is found is proved by replay, and kept.

    Attributes:
        rows: (T+1, 11) states of the own boat.
        boat: the own boat.
        tracks: (T+1, m, 2) positions of the others.
        inside: (T+1, m) whether each of them is within the radius.
        end: index of the last state up to which the radius must be kept.
        radius_m: separation radius.
        dt_s: length of a step.
        settings: of the judgement.
        numbers: the own boat's parameters.
        searches: how many were made.
        plans: proved, by the step they begin at.
        failures: searches that found nothing, by step and level: whether they dropped no state.
    """

    rows: Array
    boat: Boat
    tracks: Array
    inside: NDArray[np.bool_]
    end: int
    radius_m: float
    dt_s: float
    settings: Settings
    numbers: Array
    searches: int = 0
    plans: dict[int, Plan] = field(default_factory=dict)
    failures: dict[tuple[int, Level], bool] = field(default_factory=dict)

    def answer(self, begin: int, level: Level) -> bool:
        """Search from state ``begin``; a plan found is kept."""
        if begin in self.plans:
            return True
        if (begin, level) in self.failures:
            return False
        start, tracks, whole = self.rows[begin].copy(), self._tracks(begin), True
        reach = self.radius_m + 1.0 + self.dt_s * max(self.boat.top_mps(), start[3]) * np.arange(len(tracks))
        near = (np.hypot(*np.moveaxis(tracks - start[:2], -1, 0)) <= reach[:, None]).any(axis=0)
        others = np.ascontiguousarray(tracks[:, near])  # those that the own boat could come near at all
        for first_s in level.schedules:
            found, dropped_none = self._search(begin, start, others, level, first_s)
            if found is not None:
                self.plans[begin] = self._proved(begin, found, tracks)
                return True
            whole = whole and dropped_none
        self.failures[begin, level] = whole
        return False

    @property
    def exhausted(self) -> bool:
        """Whether the full searches that failed dropped no state."""
        return all(whole for (_, level), whole in self.failures.items() if level == self.settings.full)

    def _search(
        self, begin: int, start: Array, others: Array, level: Level, first_s: tuple[float, ...]
    ) -> tuple[Array | None, bool]:
        """Search with one schedule: the commands (S, 2) of a plan, None without; whether no state was dropped."""
        self.searches += 1
        lengths = _lengths(first_s, self.end - begin, self.dt_s)
        rudders, actions = np.array(sorted(level.rudders)), np.zeros(lengths.size, dtype=np.int64)
        sizes = np.array([level.position_m, level.position_m, level.heading_deg, level.speed_mps, level.thrust])
        task = Task(self.numbers, others, self.radius_m + ROUNDING_M, self.dt_s, rudders, sizes)
        found, whole = search(task, start, lengths, level.width, actions)
        if not found:
            return None, whole
        commands = np.empty((self.end - begin, 2))
        commands_of(task, start, actions, lengths, commands)
        return commands, whole

    def _tracks(self, begin: int) -> Array:
        """Tracks from ``begin`` on; a boat that is inside at that step is far away until it was apart."""
        tracks = self.tracks[begin : self.end + 1].copy()
        tracks[np.logical_and.accumulate(self.inside[begin : self.end + 1], axis=0)] = FAR_M
        return tracks

    def _proved(self, begin: int, commands: Array, others: Array) -> Plan:
        """Replay the commands against all boats; a plan counts only when that, too, stays clear."""
        path, headings = np.empty((len(commands) + 1, 2)), np.empty(len(commands))
        closest_m = replay(self.numbers, self.rows[begin], commands, others, self.dt_s, path, headings)
        if not closest_m > self.radius_m:
            raise OracleError(f"the plan from step {begin} does not hold in the replay; report the record")
        absolute = np.array([turned(h, e) for h, e in zip(headings, commands[:, 1], strict=True)])
        return Plan(begin, commands[:, 0], commands[:, 1], absolute, path, closest_m)


def _lengths(first_s: tuple[float, ...], steps: int, dt_s: float) -> IntArray:
    """Split a number of steps into choices: the first lengths as given, then the last one over and over."""
    lengths: list[int] = []
    left = steps
    while left > 0:
        wanted_s = first_s[min(len(lengths), len(first_s) - 1)]
        lengths.append(min(left, max(1, round(wanted_s / dt_s))))
        left -= lengths[-1]
    return np.array(lengths, dtype=np.int64)
