"""Judging a separation violation: could own commands have kept the radius, until when, and who let that pass?

Own commands may begin to differ at any step of the last T seconds before the violation at which the pair is apart. All
other tracks stay fixed. The violation is avoidable if, from one of those steps on, some sequence of commands keeps the
radius from every boat until the pair was apart again, plus a settle time. A third boat already inside the radius when
the commands begin is a separate violation: it is ignored until it was apart in the record, and avoided from then on.

Between two steps without an entry in between, a boat that can avoid from the later step can also avoid from the
earlier one, by following the recorded track. Growing leads and bisection therefore find the latest such step.

A current carries all boats alike. In the frame of the water boats obey their own equations and distances are the same,
so plans are searched there. With a command delay, a search starts from the first state that the command can change.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .boat_model import MEMORY, N_STATE, Array, IntArray, replay, rows_of, top_mps, turned
from .search import Task, commands_of, search
from .verdict import (
    AT_ONCE,
    Level,
    Motion,
    OracleError,
    Outcome,
    Plan,
    Responsible,
    Settings,
    Verdict,
    ViolationVerdict,
)

ROUNDING_M = 1e-9
"""Added to the radius, so that a plan replayed with other rounding is still clear, m."""
FAR_M = 1e9
"""Position given to boats that need not be avoided, m."""
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
    motion: Motion = AT_ONCE,
) -> Verdict:
    """Decide whether a boat could have avoided a separation violation.

    Args:
        states: (T+1, n, 11) state rows of all boats; index k after k steps.
        boats: parameters of the n boats: `Boat`s or the simulator's rows (n, 38).
        own: index of the judged boat.
        step: index of the first state inside the radius.
        radius_m: separation, m; exactly that distance counts as inside.
        dt_s: length of a step, s.
        other: the boat it came too close to; default: the nearest at ``step``.
        settings: look-back times and search resolution.
        motion: current and delays of the record.

    Raises:
        OracleError: the record, boats or numbers cannot be judged, or there is no violation at ``step``.
    """
    return _judge(_record_of(states, boats, radius_m, dt_s, settings, motion), own, step, other)


def judge_violation(
    states: Any, boats: Any, pair: tuple[int, int], step: int, radius_m: float, dt_s: float = 0.1, **rest: Any
) -> ViolationVerdict:
    """Judge a violation from both sides; further arguments as for `judge_violations`."""
    return judge_violations(states, boats, [(step, *pair)], radius_m, dt_s, **rest)[0]


def judge_violations(
    states: Any,
    boats: Any,
    violations: Iterable[Any],
    radius_m: float,
    dt_s: float = 0.1,
    driven: Any = None,
    settings: Settings = DEFAULT,
    motion: Motion = AT_ONCE,
) -> list[ViolationVerdict]:
    """Judge separation violations of one record, each from both sides; other arguments as for `judge`.

    ``violations``: rows (step, boat a, boat b, ...); further columns are ignored. ``driven``: (T, n) bool, whether the
    game controlled the boat in step k -> k+1; None: never.

    Raises:
        OracleError: see `judge`, or ``driven`` has another shape or type.
    """
    rows = [tuple(int(value) for value in row[:3]) for row in violations]
    if not rows:
        return []
    record, verdicts = _record_of(states, boats, radius_m, dt_s, settings, motion), []
    expected = (len(record.states) - 1, len(record.boats))
    game = np.zeros(expected, dtype=np.bool_) if driven is None else np.asarray(driven)
    if game.shape != expected or game.dtype != np.bool_:
        raise OracleError(
            f"driven is {game.dtype} of shape {game.shape}; give bool of shape {expected}, one row per step"
        )
    for step, a, b in rows:
        first, second = _judge(record, a, step, b), _judge(record, b, step, a)
        verdicts.append(ViolationVerdict(step, first, second, Responsible.of(first, second, game)))
    return verdicts


@dataclass(frozen=True)
class _Record:
    """A checked record; ``way_m`` (T+1, 2) is the displacement of the water."""

    states: Array
    boats: Array
    radius_m: float
    dt_s: float
    settings: Settings
    delay_steps: tuple[int, ...]
    way_m: Array


def _record_of(states: Any, boats: Any, radius_m: float, dt_s: float, settings: Settings, motion: Motion) -> _Record:
    """Check a record.

    Raises:
        OracleError: wrong shape, fewer than two boats or one step, or non-finite numbers.
    """
    try:
        table = np.ascontiguousarray(states, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OracleError(f"states must be numbers in one array (steps + 1, boats, {N_STATE}); got {error}") from error
    if table.ndim != 3 or table.shape[2] != N_STATE:
        raise OracleError(f"states have shape (steps + 1, boats, {N_STATE}); got {table.shape}")
    if table.shape[0] < 2 or table.shape[1] < 2:
        raise OracleError(f"a violation takes two boats and at least one step; the states have shape {table.shape}")
    plain = np.delete(table, MEMORY, axis=2)
    if not np.isfinite(plain).all() or np.isinf(table).any():
        k, boat = np.argwhere(~np.isfinite(plain).all(axis=2) | np.isinf(table).any(axis=2))[0]
        raise OracleError(f"the state of boat {boat} at step {k} is not finite; check the recorder or cut the record")
    for name, value in (("radius_m", radius_m), ("dt_s", dt_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise OracleError(f"{name} is {value}; give a positive, finite number")
    rows = rows_of(boats)
    if len(rows) != table.shape[1]:
        raise OracleError(f"the states hold {table.shape[1]} boats but {len(rows)} parameter sets were given")
    delays = motion.delay_steps or (0,) * len(rows)
    if len(delays) != len(rows):
        raise OracleError(f"delay_steps holds {len(delays)} of {len(rows)} boats; give one per boat")
    way_m = np.arange(len(table))[:, None] * dt_s * np.array(motion.current_mps)
    return _Record(table, rows, float(radius_m), dt_s, settings, delays, way_m)


def _partner(record: _Record, own: int, step: int, other: int | None) -> int:
    """Return the boat that the own boat came too close to in that step.

    Raises:
        OracleError: there is no such boat, or no violation at that step.
    """
    states, steps, n = record.states, len(record.states) - 1, len(record.boats)
    for boat in (own, *(() if other is None else (other,))):
        if not 0 <= boat < n:
            raise OracleError(f"there is no boat {boat}; the record's boats are 0..{n - 1}")
    if not 1 <= step <= steps:
        raise OracleError(f"there is no step {step} to judge; the record's steps are 1..{steps}")
    before, gaps = (np.hypot(*(states[k, :, :2] - states[k, own, :2]).T) for k in (step - 1, step))
    gaps[own] = np.inf
    partner = int(np.argmin(gaps)) if other is None else int(other)
    if not gaps[partner] <= record.radius_m or (step > 1 and before[partner] <= record.radius_m):
        raise OracleError(
            f"boats {own} and {partner} are {gaps[partner]:.3f} m apart at step {step} and {before[partner]:.3f} m "
            f"before it, which is no violation of {record.radius_m:g} m; give the first step inside the radius"
        )
    return partner


def _judge(record: _Record, own: int, step: int, other: int | None) -> Verdict:
    """Judge one boat's side of a violation."""
    partner, settings = _partner(record, own, step, other), record.settings
    tracks = np.ascontiguousarray(np.delete(record.states[:, :, :2], own, axis=1))
    column = partner - (partner > own)
    gaps = np.hypot(*np.moveaxis(tracks - record.states[:, None, own, :2], -1, 0))
    look, settle, longest = (
        round(time_s / record.dt_s) for time_s in (settings.look_back_s, settings.settle_s, settings.longest_s)
    )
    apart = np.flatnonzero(gaps[step : step + longest + 1, column] > record.radius_m)
    end = min(len(gaps) - 1, step + (int(apart[0]) if apart.size else longest) + settle)
    first, delay = max(0, step - look), record.delay_steps[own]
    changed = min(step, first + delay)  # the first state that the earliest command can change
    inside = gaps <= record.radius_m + ROUNDING_M
    asked = Question(record, own, tracks, inside, end)
    outcome, plan, exhausted, last = Outcome.UNAVOIDABLE, None, None, None
    if inside[:step, column].all():
        outcome, exhausted = Outcome.STARTED_INSIDE, True
    else:
        for low, high in reversed(runs(inside[changed:step], column, changed)):
            latest, exhausted = asked.latest(low, high)
            if latest is not None:
                outcome, plan, last = Outcome.AVOIDABLE, asked.plans[latest], latest - delay
                plan = replace(plan, path_m=plan.path_m + record.way_m[latest : end + 1])
                break
    return Verdict(
        own=own,
        other=partner,
        step=step,
        radius_m=record.radius_m,
        outcome=outcome,
        last_step=last,
        last_preventable_s=None if last is None else (step - last) * record.dt_s,
        looked_back_s=(step - first) * record.dt_s,
        end_step=end,
        plan=plan,
        exhausted=asked.exhausted if exhausted is None else exhausted,
        searches=asked.searches,
    )


def runs(inside: NDArray[np.bool_], partner: int, first: int) -> list[tuple[int, int]]:
    """Return stretches of steps with the pair apart and no other boat entering, as (first, last) indices of the record.

    ``inside`` (steps, m): whether each boat is within the radius, from step ``first`` on; ``partner``: the pair's
    column.
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


class Question:
    """Search for plans that keep a boat clear from a step on, in the frame of the water; replay proves each plan.

    ``tracks`` (T+1, m, 2) are the others' positions; ``inside`` (T+1, m) whether they are within the radius. The radius
    must be kept up to state ``end``.
    """

    def __init__(self, record: _Record, own: int, tracks: Array, inside: NDArray[np.bool_], end: int) -> None:
        self.record, self.p, self.inside, self.end = record, record.boats[own], inside, end
        self.rows, self.tracks = record.states[:, own].copy(), tracks - record.way_m[:, None]
        self.rows[:, :2] -= record.way_m
        self.searches = 0
        self.plans: dict[int, Plan] = {}
        self.failures: dict[tuple[int, Level], bool] = {}
        """Failed searches, by step and level: whether they dropped no state for lack of width."""

    @property
    def exhausted(self) -> bool:
        """Whether the failed full searches dropped no state."""
        return all(whole for (_, level), whole in self.failures.items() if level == self.record.settings.full)

    def latest(self, low: int, high: int) -> tuple[int | None, bool]:
        """Find the latest step of [low, high] from which the violation can be avoided.

        Returns:
            The step, or None; whether the search that failed after it was exhausted.
        """
        quick, full = self.record.settings.quick, self.record.settings.full
        best, failed = self._bracket(low, high, quick, growth=2)
        if best is None:
            best, failed = self._bracket(low, high, full, growth=4)
            if best is None:
                return None, self.exhausted
        else:
            best, failed = self._bisect(best, failed, quick)
            failed, stride = high + 1, 1
            while best < high:  # try later steps in growing strides until the full search fails
                begin = min(high, best + stride)
                if not self.answer(begin, full):
                    failed = begin
                    break
                best, stride = begin, 2 * stride
        best, failed = self._bisect(best, failed, full)
        return best, failed > high or self.failures[failed, full]

    def _bracket(self, low: int, high: int, level: Level, growth: int) -> tuple[int | None, int]:
        """Multiply the lead until a search succeeds; return its step (or None) and the latest failed step."""
        failed, lead = high + 1, 0
        while True:
            begin = max(low, high - lead)
            if self.answer(begin, level):
                return begin, failed
            if begin == low:
                return None, low
            failed, lead = begin, growth * lead + growth - 1

    def _bisect(self, best: int, failed: int, level: Level) -> tuple[int, int]:
        while failed - best > 1:
            middle = (best + failed) // 2
            best, failed = (middle, failed) if self.answer(middle, level) else (best, middle)
        return best, failed

    def answer(self, begin: int, level: Level) -> bool:
        """Return whether a search from state ``begin`` finds a plan; cache the result."""
        if begin in self.plans:
            return True
        if (begin, level) in self.failures:
            return False
        record, start, length = self.record, self.rows[begin].copy(), self.end - begin
        tracks, whole = self.tracks[begin : self.end + 1].copy(), True
        # ignore a boat that is inside at ``begin`` until it was apart
        tracks[np.logical_and.accumulate(self.inside[begin : self.end + 1], axis=0)] = FAR_M
        reach = record.radius_m + 1.0 + record.dt_s * max(top_mps(self.p), start[3]) * np.arange(len(tracks))
        near = (np.hypot(*np.moveaxis(tracks - start[:2], -1, 0)) <= reach[:, None]).any(axis=0)
        others = np.ascontiguousarray(tracks[:, near])  # only boats that the own boat can come near
        rudders, limit_m = np.array(sorted(level.rudders)), record.radius_m + ROUNDING_M
        task = Task(self.p, others, limit_m, record.dt_s, rudders, np.array(level.cells))
        for first_s in level.schedules:
            self.searches += 1
            lengths = _lengths(first_s, length, record.dt_s)
            actions, commands = np.zeros(lengths.size, dtype=np.int64), np.empty((length, 2))
            found, dropped_none = search(task, start, lengths, level.width, actions)
            if found:
                commands_of(task, start, actions, lengths, commands)
                self.plans[begin] = self._proved(begin, commands, tracks)
                return True
            whole = whole and dropped_none
        self.failures[begin, level] = whole
        return False

    def _proved(self, begin: int, commands: Array, others: Array) -> Plan:
        """Replay the commands against all boats; raise `OracleError` if the replay does not stay clear."""
        path, headings = np.empty((len(commands) + 1, 2)), np.empty(len(commands))
        closest_m = replay(self.p, self.rows[begin], commands, others, self.record.dt_s, path, headings)
        if not closest_m > self.record.radius_m:
            raise OracleError(f"the plan from step {begin} does not hold in the replay; report the record")
        absolute = np.array([turned(h, e) for h, e in zip(headings, commands[:, 1], strict=True)])
        return Plan(begin, commands[:, 0], commands[:, 1], absolute, path, closest_m)


def _lengths(first_s: tuple[float, ...], steps: int, dt_s: float) -> IntArray:
    """Split a number of steps into choices: the given lengths first, then the last one repeatedly."""
    lengths: list[int] = []
    while (left := steps - sum(lengths)) > 0:
        wanted_s = first_s[min(len(lengths), len(first_s) - 1)]
        lengths.append(min(left, max(1, round(wanted_s / dt_s))))
    return np.array(lengths, dtype=np.int64)
