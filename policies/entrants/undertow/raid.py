"""The phases of a raid, and when each gives way to the next."""

from __future__ import annotations

from enum import IntEnum

from ..plane import distance
from ..sight import Boat, Sight
from .chart import Chart

BAIT, DRAG, RUN = 0, 1, 2
"""Numbers of the boats by their part."""
AT_POST_M = 5.0
NEAR_M = 17.0
"""The second boat sets out when the guard is so near to the bait, m."""
DRAGGED_M, GAP_M = 10.0, 12.0
"""The third sets out when the second is so far beyond the line and the guard farther than this from the third, m."""
BAITED_S, LONGEST_S, STALE_S, AGAIN_S = 25.0, 60.0, 30.0, 15.0
"""Longest time for a bait, for a raid, that a blocked chart is kept, and how much of that a success takes off, s."""


class Phase(IntEnum):
    """What a team is at."""

    GATHER = 0
    BAIT = 1
    DRAG = 2
    RUN = 3


class Raid:
    """Where a team is in its raid.

    Attributes:
        phase: what it is at.
        upper: see `Chart`.
        bait_taken: whether the bait was tagged since the second boat set out.
    """

    def __init__(self, sight: Sight) -> None:
        self.phase, self.upper, self.bait_taken = Phase.GATHER, True, False
        self._since_s, self._kept_s, self._held = sight.time, sight.time, False

    def advance(self, sight: Sight) -> Chart:
        """Look at the game, go on to the next phase or give up; where the raid leads."""
        chart = Chart(sight, self.upper)
        taggers = [foe for foe in sight.foes if may_tag(foe, sight)]
        guard = guard_of(taggers, sight)
        is_open = chart.is_open([foe.at for foe in taggers if foe is not guard])
        if self.phase == Phase.GATHER:
            self._gathered(sight, chart, guard, is_open)
        elif self._failed(sight, is_open):
            self._end(sight.time)
        self._brought_home(sight)
        if guard is not None:
            self._went_on(sight, chart, guard)
        if self.phase >= Phase.DRAG:
            self.bait_taken = self.bait_taken or sight.own[BAIT].tagged
        return Chart(sight, self.upper)

    def _gathered(self, sight: Sight, chart: Chart, guard: Boat | None, is_open: bool) -> None:
        posts = zip(sight.own, chart.posts, strict=False)
        ready = all(not boat.tagged and boat.on_side and distance(boat.at, post) < AT_POST_M for boat, post in posts)
        if ready and is_open and guard is not None and not sight.taken:
            self.phase, self._since_s, self._held, self.bait_taken = Phase.BAIT, sight.time, False, False
        elif not is_open and sight.time - self._kept_s > STALE_S:
            self.upper, self._kept_s = not self.upper, sight.time

    def _failed(self, sight: Sight, is_open: bool) -> bool:
        bait, drag, run = sight.own[:3]
        lasted_s = sight.time - self._since_s
        if run.tagged or lasted_s > LONGEST_S:
            return True
        if self.phase == Phase.BAIT:
            return bait.tagged or drag.tagged or not is_open or lasted_s > BAITED_S
        return drag.tagged and (self.phase == Phase.DRAG or (run.on_side and run.x < sight.line - 1.0))

    def _brought_home(self, sight: Sight) -> None:
        """End a raid once the flag was held and is no more."""
        if sight.own[DRAG].carries or sight.own[RUN].carries:
            self._held = True
        elif self._held and self.phase > Phase.GATHER:
            self._end(sight.time - AGAIN_S)

    def _went_on(self, sight: Sight, chart: Chart, guard: Boat) -> None:
        bait, drag, run = sight.own[:3]
        out = bait.x > sight.line or bait.tagged
        above = chart.height(guard.at) > 0.5 * sight.size[1] + 1.0
        if self.phase == Phase.BAIT and out and above and distance(guard.at, bait.at) < NEAR_M:
            self.phase = Phase.DRAG
        drawn = drag.x > sight.line + DRAGGED_M and chart.height(guard.at) < 0.5 * sight.size[1] + 6.0
        if self.phase == Phase.DRAG and drawn and distance(guard.at, run.at) > GAP_M:
            self.phase = Phase.RUN

    def _end(self, kept_s: float) -> None:
        self.phase, self._kept_s = Phase.GATHER, kept_s


def may_tag(foe: Boat, sight: Sight) -> bool:
    """Whether a boat on its own side may tag, or soon will: near its base a tagged one is free again in a moment."""
    return foe.on_side and (not foe.tagged or distance(foe.at, sight.base) <= 1.4 * sight.reach)


def guard_of(taggers: list[Boat], sight: Sight) -> Boat | None:
    """The one nearest to where a guard stands, before its flag."""
    before = sight.base[0] - 1.3 * sight.reach, sight.base[1]
    return min(taggers, key=lambda foe: distance(foe.at, before), default=None)
