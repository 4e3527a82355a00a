"""A way to the flag and home that passes opponents while they are elsewhere.

Opponents are predicted by their habit, or assumed to steer at the boat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..observation import Boat, Observation, Point
from ..plane import distance
from .habits import Habits, Track

STEP_M = 2.0
"""Distance between points of a way that are checked for opponents."""
LOOKS = 40
"""Number of checked points of a way."""
ACROSS_SHARES = (0.06, 0.18, 0.29, 0.4, 0.5, 0.6, 0.71, 0.82, 0.94)
"""Where a way may bend or come home, in shares of the field's height."""
ALONG_SHARES = (0.12, 0.3, 0.5, 0.7)
"""Where a way may bend, in shares of the distance from the line to the flag."""
GRABS, INSIDE_M = 8, 2.0
"""Points round the flag at which it may be grabbed, and their distance from the field's edge, m."""
ENOUGH_M = 6.0
"""More room than this does not justify a longer way."""
ROOM_FIRST = 1000.0
"""Metres of way that a metre of room is traded for; of two ways with equal room the shorter is chosen."""
AHEAD_S = 90
"""Longest prediction."""
WAKES_S = 2.0
"""Time before and after a tagged opponent's release during which ways avoid it."""

Numbers = NDArray[np.float64]


def slack_m(obs: Observation, boat: Boat, grab: Point, home: Point) -> float:
    """Return by how much opponents that try to cut a boat off would miss it, m; below 0 they tag it.

    The boat sails at full speed to where it grabs the flag, and home. Opponents sail at full speed to that point of its
    way on their side that they reach best. Tagged ones first go to their base. Those on the boat's side start when it
    grabs the flag, all others at once.
    """
    legs = [(boat.at, grab), (grab, home)]
    points = np.concatenate([np.linspace(a, b, max(int(distance(a, b) / STEP_M), 1) + 1)[1:] for a, b in legs])
    gone_m = np.cumsum(np.hypot(*np.diff(points, axis=0, prepend=[boat.at]).T))
    grabs_s = distance(*legs[0]) / boat.top
    there = points[:, 0] > obs.line
    points, times = points[there], gone_m[there] / boat.top
    slacks = [np.inf]
    for foe in obs.foes:
        at, from_s = foe.at, 0.0 if foe.on_side else grabs_s
        if foe.tagged:
            share = max(1.0 - obs.reach / max(distance(foe.at, obs.base), 1e-9), 0.0)
            at = foe.x + share * (obs.base[0] - foe.x), foe.y + share * (obs.base[1] - foe.y)
            from_s = distance(foe.at, at) / foe.top
        gap = np.hypot(*(points - at).T) - obs.reach - foe.top * np.maximum(times - from_s, 0.0)
        slacks.append(float(gap.min(initial=np.inf)))
    return min(slacks)


class Waters:
    """What is known of the opponents from a moment on.

    Args:
        obs: the moment.
        habits: of the opponents.
        keep_m: required distance of a way from the reach of opponents with a habit, m.
        free_m: required miss distance of other opponents that try to cut the boat off, see `slack_m`, m.
    """

    def __init__(self, obs: Observation, habits: Habits, keep_m: float, free_m: float) -> None:
        self.obs, self._keep_m, self._free_m = obs, keep_m, free_m
        self._tracks = [habits.track(number, AHEAD_S) for number in range(len(obs.foes))]

    def room_m(self, points: Numbers, times_s: Numbers, grabs_s: Numbers) -> Numbers:
        """Return the room on ways: the least distance to opponents beyond the required one, m."""
        rooms = np.full(points.shape[:2], np.inf)
        for foe, track in zip(self.obs.foes, self._tracks, strict=True):
            if track is None:
                room = self._of_chaser_m(foe, points, times_s, grabs_s)
            else:
                room = self._of_track_m(track, points, times_s)
            rooms = np.minimum(rooms, room)
        nearest: Numbers = np.where(points[..., 0] > self.obs.line, rooms, np.inf).min(axis=1)
        return nearest

    def _of_track_m(self, track: Track, points: Numbers, times_s: Numbers) -> Numbers:
        """Return the room (W, n) to an opponent whose motion is predicted."""
        then = track[np.clip(np.rint(times_s).astype(int) - 1, 0, AHEAD_S - 1)]
        room_m = np.linalg.norm(points - then[..., :2], axis=-1) - self.obs.reach - self._keep_m
        found: Numbers = np.where(then[..., 2] > 0.0, room_m, np.inf)
        return found

    def _of_chaser_m(self, foe: Boat, points: Numbers, times_s: Numbers, grabs_s: Numbers) -> Numbers:
        """Return the room (W, n) to an opponent that may do anything."""
        at, free_s = np.array(foe.at), np.zeros_like(grabs_s) if foe.on_side else grabs_s
        if foe.tagged:
            share = max(1.0 - self.obs.reach / max(distance(foe.at, self.obs.base), 1e-9), 0.0)
            at = at + share * (np.array(self.obs.base) - at)
            free_s = np.full_like(grabs_s, distance(foe.at, (at[0], at[1])) / foe.top)
        off_m: Numbers = np.linalg.norm(points - at, axis=-1) - self.obs.reach
        room_m: Numbers = off_m - foe.top * np.maximum(times_s - free_s[:, None], 0.0) - self._free_m
        if foe.tagged:
            wakes = np.abs(times_s - free_s[:, None]) < WAKES_S
            room_m = np.minimum(room_m, np.where(wakes, off_m - self._keep_m, np.inf))
        return room_m


@dataclass(frozen=True)
class Passage:
    """A way.

    Attributes:
        room_m: see `Waters.room_m`, the least until the boat is home.
        points: its bends and its end.
    """

    room_m: float
    points: tuple[Point, ...]


def outward(waters: Waters, boat: Boat) -> Passage:
    """Return the best way to a place where the flag is grabbed, taking the way home into account."""
    found = []
    for grab in _grabs(waters.obs):
        ways = _out_ways(waters.obs, boat.at, grab)
        rooms_m, long_m = _looked_at(waters, boat, ways, 0.0, carries=False)
        out = _best(rooms_m, long_m)
        back = _home_ways(waters.obs, grab)
        back_rooms_m, back_m = _looked_at(waters, boat, back, long_m[out] / boat.top, carries=True)
        home = _best(back_rooms_m, back_m)
        room_m = float(min(rooms_m[out], back_rooms_m[home]))
        worth = ROOM_FIRST * min(room_m, ENOUGH_M) - long_m[out] - back_m[home]
        found.append((worth, Passage(room_m, _points(ways[out]))))
    return max(found, key=lambda one: one[0])[1]


def homeward(waters: Waters, boat: Boat) -> Passage:
    """Return the best way to the own side for a boat with the flag."""
    ways = _home_ways(waters.obs, boat.at)
    rooms_m, long_m = _looked_at(waters, boat, ways, 0.0, carries=True)
    best = _best(rooms_m, long_m)
    return Passage(float(rooms_m[best]), _points(ways[best]))


def _best(rooms_m: Numbers, long_m: Numbers) -> int:
    return int(np.argmax(ROOM_FIRST * np.minimum(rooms_m, ENOUGH_M) - long_m))


def _grabs(obs: Observation) -> list[Point]:
    """Return the points in the field from which the flag can be grabbed."""
    reach_m, (width, height) = obs.reach - 1.0, obs.size
    angles = [2.0 * math.pi * k / GRABS for k in range(GRABS)]
    points = [(obs.goal[0] + reach_m * math.cos(a), obs.goal[1] + reach_m * math.sin(a)) for a in angles]
    return [(x, y) for x, y in points if INSIDE_M < x < width - INSIDE_M and INSIDE_M < y < height - INSIDE_M]


def _bends(obs: Observation) -> Numbers:
    """Return the points (B, 2) at which ways may bend, height by height."""
    along = obs.line + np.array(ALONG_SHARES) * (obs.base[0] - obs.line)
    return np.array([(x, share * obs.size[1]) for share in ACROSS_SHARES for x in along])


def _out_ways(obs: Observation, at: Point, grab: Point) -> Numbers:
    """Return ways (W, 3, 2) to a grab: straight, and with one bend."""
    bends = np.concatenate([[grab], _bends(obs)])
    return np.stack([np.broadcast_to(at, bends.shape), bends, np.broadcast_to(grab, bends.shape)], axis=1)


def _home_ways(obs: Observation, at: Point) -> Numbers:
    """Return ways (W, 3, 2) home: straight to a place at the line, and with a bend at its height."""
    ends = np.array([(obs.line - 1.0, share * obs.size[1]) for share in ACROSS_SHARES])
    bends = np.concatenate([ends, _bends(obs)])
    ends = np.concatenate([ends, np.repeat(ends, len(ALONG_SHARES), axis=0)])
    return np.stack([np.broadcast_to(at, bends.shape), bends, ends], axis=1)


def _looked_at(waters: Waters, boat: Boat, ways: Numbers, from_s: float, carries: bool) -> tuple[Numbers, Numbers]:
    """Return the room (W,) on ways (W, 3, 2) begun at a time at full speed, and their lengths (W,), m."""
    legs_m = np.linalg.norm(np.diff(ways, axis=1), axis=-1)
    long_m = legs_m.sum(axis=1)
    gone_m = np.linspace(1.0 / LOOKS, 1.0, LOOKS) * long_m[:, None]
    first = np.clip(gone_m / np.maximum(legs_m[:, :1], 1e-9), 0.0, 1.0)[..., None]
    second = np.clip((gone_m - legs_m[:, :1]) / np.maximum(legs_m[:, 1:], 1e-9), 0.0, 1.0)[..., None]
    points = ways[:, None, 0] + first * (ways[:, 1] - ways[:, 0])[:, None] + second * (ways[:, 2] - ways[:, 1])[:, None]
    grabs_s = from_s + (np.zeros_like(long_m) if carries else long_m / boat.top)
    return waters.room_m(points, from_s + gone_m / boat.top, grabs_s), long_m


def _points(way: Numbers) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in way[1:])
