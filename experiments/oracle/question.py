"""One question of a judgement: can the boat keep clear from a given step on?"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .boat import Array
from .errors import OracleError
from .model import replay, turned
from .search import Task, commands_of, search
from .settings import Level, Settings
from .verdict import Plan

ROUNDING_M = 1e-9
"""Kept above the radius, so that a plan replayed with other rounding is still clear."""
FAR_M = 1e9
"""Where boats are that need not be kept clear of, m."""


@dataclass
class Question:
    """The own boat, the others' tracks and what was found so far; what is found is proved by replay.

    Attributes:
        rows: (T+1, 11) states of the own boat.
        numbers: its parameters.
        tracks: (T+1, m, 2) positions of the others.
        inside: (T+1, m) whether each of them is within the radius.
        end: index of the last state up to which the radius must be kept.
        radius_m: separation radius.
        dt_s: length of a step.
        top_mps: speed the own boat never exceeds.
        settings: of the judgement.
        searches: how many were made.
        plans: proved, by the step they begin at.
        failures: searches that found nothing, by step and level: whether they dropped no state.
    """

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
        start, others = self.rows[begin].copy(), self._reachable(begin)
        whole = [self._search(begin, start, others, level, first_s) for first_s in level.schedules]
        if begin not in self.plans:
            self.failures[begin, level] = all(whole)
        return begin in self.plans

    def _search(self, begin: int, start: Array, others: Array, level: Level, first_s: tuple[float, ...]) -> bool:
        """Search with one schedule unless a plan is known; returns whether no state was dropped."""
        if begin in self.plans:
            return True
        self.searches += 1
        lengths = _lengths(first_s, self.end - begin, self.dt_s)
        rudders, actions = np.array(sorted(level.rudders)), np.zeros(lengths.size, dtype=np.int64)
        sizes = np.array([level.position_m, level.position_m, level.heading_deg, level.speed_mps, level.thrust])
        task = Task(self.numbers, others, self.radius_m + ROUNDING_M, self.dt_s, rudders, sizes)
        found, whole = search(task, start, lengths, level.width, actions)
        if not found:
            return whole
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


def _lengths(first_s: tuple[float, ...], steps: int, dt_s: float) -> NDArray[np.int64]:
    """Split a number of steps into choices: the first lengths as given, then the last one over and over."""
    lengths: list[int] = []
    left = steps
    while left > 0:
        wanted_s = first_s[min(len(lengths), len(first_s) - 1)]
        lengths.append(min(left, max(1, round(wanted_s / dt_s))))
        left -= lengths[-1]
    return np.array(lengths, dtype=np.int64)
