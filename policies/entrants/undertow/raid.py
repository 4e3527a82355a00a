"""A raid: its ways, its phases, and when they change."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from ..observation import Boat, Observation, Point
from ..plane import clip, distance
from .habits import Watch
from .passage import Passage, Waters, homeward, outward, slack_m
from .shape import SCRIPTED, WIDE_M, Shape

BAIT, DRAG, RUN = 0, 1, 2
"""Numbers of the boats by their part."""
LONGEST_S, AGAIN_S = 60.0, 15.0
"""Longest time of a raid, and how much a success takes off the time that a side is kept, s."""
KEEP_M, MOVES_S = 2.0, 20.0
"""Required distance of the third boat's way from the reach of opponents with a habit when it starts, m; and the time
after which it waits elsewhere, s.
"""
GRABS_DEG = (0.0, 30.0, 60.0)
"""Where a lone boat may grab: angles round the flag, from before it towards the boat's edge."""

WAIT_SHARES = (0.15, 0.5, 0.85, 0.5)
"""Where a boat waits for a passage, in shares of the field's height."""


@dataclass(frozen=True)
class Chart:
    """Points of a raid.

    Attributes:
        obs: the moment.
        upper: the bait is at the edge of large y; otherwise everything is mirrored.
        shape: its numbers.
    """

    obs: Observation
    upper: bool
    shape: Shape = SCRIPTED

    def at(self, x: float, y: float) -> Point:
        """Return a point given for the bait at the upper edge, m."""
        return (x, y) if self.upper else (x, self.obs.size[1] - y)

    def height(self, point: Point) -> float:
        """Return a point's y as if the bait were at the upper edge, m."""
        return self.at(*point)[1]

    @property
    def posts(self) -> list[Point]:
        """Where bait, second and third boat gather."""
        line, top, shape = self.obs.line, self.obs.size[1], self.shape
        return [
            self.at(line - 2.0, top - shape.bait_m),
            self.at(line - 2.0, shape.drag_m + 1.0),
            self.at(line - shape.wait_x_m, top - shape.wait_m),
        ]

    @property
    def bait(self) -> Point:
        """Where the bait stands: just far enough beyond the line to be an intruder."""
        return self.at(self.obs.line + self.shape.bait_x_m, self.obs.size[1] - self.shape.bait_m)

    @property
    def door(self) -> Point:
        """Where the third boat waits for its turn."""
        return self.at(self.obs.line - self.shape.door_x_m, self.obs.size[1] - self.shape.door_m)

    def drag(self, at: Point) -> Point:
        """Return the second boat's point: along its edge, round the far corner, then the flag."""
        base, shape = self.obs.base, self.shape
        if at[0] < base[0] - shape.corner_x_m:
            return self.at(at[0] + 12.0, shape.drag_m)
        if self.height(at) < shape.turned_m:
            return self.at(base[0] + shape.turn_x_m, base[1] - shape.turn_m)
        return self.obs.goal

    def run(self, at: Point) -> Point:
        """Return the third boat's point: past the flag on the bait's side, to turn home away from the guard."""
        base, shape = self.obs.base, self.shape
        if at[0] < self.obs.line + shape.run_x_m:
            return self.at(at[0] + 8.0, base[1] + shape.run_m)
        return self.at(base[0] + shape.past_x_m, base[1] + shape.past_m)

    @property
    def edge(self) -> Point:
        """Where the third boat waits while no opponent stays at home."""
        return self.at(self.obs.line - 2.0, self.obs.size[1] - self.shape.edge_m)

    def wait(self, place: int) -> Point:
        """Return where the third boat waits for a passage: in turn at one edge, in the middle and at the other."""
        return self.obs.line - 2.0, WAIT_SHARES[place % len(WAIT_SHARES)] * self.obs.size[1]

    def dash(self, boat: Boat) -> tuple[Point, float]:
        """Return where a lone boat grabs the flag, and by how much opponents would miss it, m."""
        (x, y), reach_m, height_m = self.obs.base, self.obs.reach - 1.0, self.obs.size[1]
        found = []
        for angle in map(math.radians, GRABS_DEG):
            up_m = reach_m * math.sin(angle)
            grab = self.at(x - reach_m * math.cos(angle), y + up_m)
            home = self.at(self.obs.line - 0.5, min(y + up_m + 6.0, height_m - 2.5))
            found.append((slack_m(self.obs, boat, grab, home), grab))
        slack, grab = max(found)
        return grab, slack

    def home(self, at: Point, up: bool) -> Point:
        """Return the point of a boat with the flag: towards its own side, and to the bait's edge or the other."""
        off_m = self.shape.home_m if up else -self.shape.drag_home_m
        return at[0] - 15.0, clip(at[1] + (off_m if self.upper else -off_m), 2.5, self.obs.size[1] - 2.5)

    def is_open(self, others: list[Point], clear_m: float) -> bool:
        """Return whether opponents other than the guard are farther than ``clear_m`` from all ways."""
        line, top, base, shape = self.obs.line, self.obs.size[1], self.obs.base, self.shape
        ways = (
            (self.at(line + 1.0, shape.drag_m), self.at(base[0] + 2.0, shape.drag_m)),
            (self.at(line, top - shape.bait_m), self.at(base[0] - 10.0, base[1] + 12.0)),
        )
        return all(off(place, *way) > clear_m for place in others for way in ways)


def off(point: Point, a: Point, b: Point) -> float:
    """Return the distance of a point from the segment between a and b, m."""
    along = b[0] - a[0], b[1] - a[1]
    share = ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / (along[0] ** 2 + along[1] ** 2)
    share = clip(share, 0.0, 1.0)
    return math.hypot(point[0] - a[0] - share * along[0], point[1] - a[1] - share * along[1])


class Phase(IntEnum):
    """Phase of a raid."""

    GATHER = 0
    BAIT = 1
    DRAG = 2
    RUN = 3


class Raid:
    """State of a team's raid.

    Attributes:
        phase: its phase.
        upper: see `Chart`.
        bait_taken: the bait was tagged since the second boat started.
        held: the flag was held in this raid.
        kept_s: time since when this side is kept, s.
        watch: who stays at home.
        unguarded: nobody stays at home to guard the flag.
        passage: of the third boat past opponents with a habit; None if there is none.
        place: number of the place where it waits for one, see `Chart.wait`.
        shape: its numbers; the script's, scaled to the field, until others are given.
    """

    def __init__(self, obs: Observation) -> None:
        self.shape = SCRIPTED.scaled(obs.size[0] / WIDE_M)
        self.phase, self.upper, self.bait_taken = Phase.GATHER, True, False
        self._since_s, self.kept_s, self.held = obs.time, obs.time, False
        self.watch, self.unguarded = Watch(obs), False
        self.passage: Passage | None = None
        self.place = 0

    def memory(self, time_s: float) -> list[float]:
        """Return its memory, without the shape, as numbers; times are relative to ``time_s``."""
        times = [self._since_s - time_s, self.kept_s - time_s]
        return [self.phase, self.upper, self.bait_taken, self.held, *times, self.unguarded]

    def remember(self, memory: Sequence[float], time_s: float, mirrored: bool) -> None:
        """Restore what `memory` returned, in the same game or its mirror image."""
        self.phase, self.upper = Phase(int(memory[0])), bool(memory[1]) != mirrored
        self.bait_taken, self.held = bool(memory[2]), bool(memory[3])
        self._since_s, self.kept_s = memory[4] + time_s, memory[5] + time_s
        self.unguarded = self.watch.nobody = bool(memory[6])

    def advance(self, obs: Observation) -> Chart:
        """Advance the raid by one look at the game: next phase, or give up; return its chart."""
        looked = self.watch.look(obs)
        if self.unguarded != self.watch.unguarded:
            self.unguarded = self.watch.unguarded
            self._end(obs.time)
        chart = Chart(obs, self.upper, self.shape)
        if not self.unguarded:
            self._raided(obs, chart)
        elif self.watch.timed:
            self._timed(obs, looked)
        else:
            self._countered(obs, chart)
        return Chart(obs, self.upper, self.shape)

    def _countered(self, obs: Observation, chart: Chart) -> None:
        """Send the third boat alone while no opponent can cut it off in time."""
        run, shape = obs.own[RUN], self.shape
        kept_at_home = self._kept_at_home(obs)
        self.passage = None
        if self.phase == Phase.GATHER:
            self.upper = run.y > 0.5 * obs.size[1]
            if not kept_at_home and Chart(obs, self.upper, shape).dash(run)[1] > shape.free_m:
                self.phase, self._since_s, self.held = Phase.RUN, obs.time, False
        elif not run.carries:
            late = obs.time - self._since_s > LONGEST_S
            if kept_at_home or late or chart.dash(run)[1] < shape.kept_free_m:
                self._end(obs.time)
        self._brought_home(obs)

    def _timed(self, obs: Observation, looked: bool) -> None:
        """Send the third boat alone past opponents with a habit, while they are elsewhere."""
        if self._kept_at_home(obs):
            self.phase, self.passage = Phase.GATHER, None
        elif looked:
            self.passage = self._passage(obs)
            begins = self.phase == Phase.GATHER and self.passage is not None
            self.held = self.held and not begins
            self.phase = Phase.GATHER if self.passage is None else Phase.RUN
            if self.passage is None and obs.time - self.kept_s > MOVES_S:
                self.place, self.kept_s = self.place + 1, obs.time
        self._brought_home(obs)

    def _passage(self, obs: Observation) -> Passage | None:
        """Return the third boat's best way at present; None if it should not go."""
        run, shape = obs.own[RUN], self.shape
        if run.carries:
            return homeward(Waters(obs, self.watch.habits, KEEP_M, shape.kept_free_m), run)
        keep_m, free_m = (0.0, shape.kept_free_m) if self.phase == Phase.RUN else (KEEP_M, shape.free_m)
        found = outward(Waters(obs, self.watch.habits, keep_m, free_m), run)
        return found if found.room_m > 0.0 else None

    def _kept_at_home(self, obs: Observation) -> bool:
        """Return whether the third boat is tagged or must protect the own flag."""
        run = obs.own[RUN]
        return run.tagged or (obs.taken and run.on_side and not run.carries)

    def _raided(self, obs: Observation, chart: Chart) -> None:
        """Send three boats to draw a guard away."""
        shape = self.shape
        taggers = [foe for foe in obs.foes if may_tag(foe, obs)]
        guard = guard_of(taggers, obs)
        clear_m = shape.clear_m if self.phase == Phase.GATHER else shape.kept_clear_m
        is_open = chart.is_open([foe.at for foe in taggers if foe is not guard], clear_m)
        if self.phase == Phase.GATHER:
            self._gathered(obs, chart, guard, is_open)
        elif self._failed(obs, is_open):
            self._end(obs.time)
        self._brought_home(obs)
        if guard is not None:
            self._went_on(obs, chart, guard)
        if self.phase >= Phase.DRAG:
            self.bait_taken = self.bait_taken or obs.own[BAIT].tagged

    def _gathered(self, obs: Observation, chart: Chart, guard: Boat | None, is_open: bool) -> None:
        posts, near_m = zip(obs.own, chart.posts, strict=False), self.shape.post_m
        ready = all(not boat.tagged and boat.on_side and distance(boat.at, post) < near_m for boat, post in posts)
        if ready and is_open and guard is not None and not obs.taken:
            self.phase, self._since_s, self.held, self.bait_taken = Phase.BAIT, obs.time, False, False
        elif not is_open and obs.time - self.kept_s > self.shape.stale_s:
            self.upper, self.kept_s = not self.upper, obs.time

    def _failed(self, obs: Observation, is_open: bool) -> bool:
        bait, drag, run = obs.own[:3]
        lasted_s = obs.time - self._since_s
        if run.tagged or lasted_s > LONGEST_S:
            return True
        if self.phase == Phase.BAIT:
            return bait.tagged or drag.tagged or not is_open or lasted_s > self.shape.baited_s
        return drag.tagged and (self.phase == Phase.DRAG or (run.on_side and run.x < obs.line - 1.0))

    def _brought_home(self, obs: Observation) -> None:
        """End a raid once the flag was held and no longer is."""
        if obs.own[DRAG].carries or obs.own[RUN].carries:
            self.held = True
        elif self.held and self.phase > Phase.GATHER:
            self._end(obs.time - AGAIN_S)

    def _went_on(self, obs: Observation, chart: Chart, guard: Boat) -> None:
        bait, drag, run = obs.own[:3]
        out = bait.x > obs.line or bait.tagged
        shape, height_m = self.shape, chart.height(guard.at) - 0.5 * obs.size[1]
        if self.phase == Phase.BAIT and out and height_m > shape.above_m and distance(guard.at, bait.at) < shape.near_m:
            self.phase = Phase.DRAG
        drawn = drag.x > obs.line + shape.dragged_m and height_m < shape.drawn_m
        if self.phase == Phase.DRAG and drawn and distance(guard.at, run.at) > shape.gap_m:
            self.phase = Phase.RUN

    def _end(self, kept_s: float) -> None:
        self.phase, self.passage, self.kept_s = Phase.GATHER, None, kept_s


def may_tag(foe: Boat, obs: Observation) -> bool:
    """Return whether a boat on its own side may tag, now or soon: near its base a tagged one is free in a moment."""
    return foe.on_side and (not foe.tagged or distance(foe.at, obs.base) <= 1.4 * obs.reach)


def guard_of(taggers: list[Boat], obs: Observation) -> Boat | None:
    """Return the opponent nearest to where a guard stands, before its flag."""
    before = obs.base[0] - 1.3 * obs.reach, obs.base[1]
    return min(taggers, key=lambda foe: distance(foe.at, before), default=None)
