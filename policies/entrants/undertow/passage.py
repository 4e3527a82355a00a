"""A way to the flag and home that passes opponents which keep a habit when they are elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..plane import distance
from ..sight import Boat, Point, Sight
from .habits import Habits, Track

LOOKS = 40
"""Points of a way that are looked at."""
ACROSS_SHARES = (0.06, 0.18, 0.29, 0.4, 0.5, 0.6, 0.71, 0.82, 0.94)
"""Where a way may bend or come home, in shares of the field's height;"""
ALONG_SHARES = (0.12, 0.3, 0.5, 0.7)
"""and in shares of the way from the line to the flag."""
GRABS = 8
"""Points round the flag at which it may be grabbed."""
WAKES_S = 2.0
"""So long before and after a tagged opponent is free again it is kept clear of, s."""
AHEAD_S = 90
"""Longest time that is looked ahead, s."""
ENOUGH_M = 6.0
"""More room than this is worth no longer way, m."""
ROOM_FOR_WAY = 1000.0
"""Room is weighed against length so much, which is to say first."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Passage:
    """A way.

    Attributes:
        room_m: how far it keeps from the reach of opponents, at the narrowest, less what is asked for, m.
        points: where it bends, and its end.
    """

    room_m: float
    points: tuple[Point, ...]


class Waters:
    """What is known of the opponents from a moment on.

    Args:
        sight: the moment.
        habits: of the opponents.
        keep_m: how far off the reach of settled ones a way has to keep, m.
        free_m: how much others that cut a boat off at once may have to spare, see `way.slack_m`, a number below 0, m.
    """

    def __init__(self, sight: Sight, habits: Habits, keep_m: float, free_m: float) -> None:
        self.sight, self._keep_m, self._free_m = sight, keep_m, free_m
        self._tracks = [habits.track(number, AHEAD_S) for number in range(len(sight.foes))]

    def room_m(self, points: Numbers, times_s: Numbers, grabs_s: Numbers) -> Numbers:
        """Room (W,) on ways through points (W, n, 2) at times (W, n), on which the flag is grabbed at times (W,)."""
        sight = self.sight
        rooms = np.full(points.shape[:2], np.inf)
        for foe, track in zip(sight.foes, self._tracks, strict=True):
            room = self._to_settled_m(track, points, times_s) if track is not None else None
            rooms = np.minimum(rooms, self._to_chaser_m(foe, points, times_s, grabs_s) if room is None else room)
        there = points[..., 0] > sight.line
        nearest: Numbers = np.where(there, rooms, np.inf).min(axis=1)
        return nearest

    def _to_settled_m(self, track: Track, points: Numbers, times_s: Numbers) -> Numbers:
        then = track[np.clip(np.rint(times_s).astype(int) - 1, 0, AHEAD_S - 1)]
        off_m = np.linalg.norm(points - then[..., :2], axis=-1) - self.sight.reach - self._keep_m
        found: Numbers = np.where(then[..., 2] > 0.0, off_m, np.inf)
        return found

    def _to_chaser_m(self, foe: Boat, points: Numbers, times_s: Numbers, grabs_s: Numbers) -> Numbers:
        at, free_s = foe.at, np.zeros_like(grabs_s) if foe.on_side else grabs_s
        if foe.tagged:
            share = max(1.0 - self.sight.reach / max(distance(foe.at, self.sight.base), 1e-9), 0.0)
            at = foe.x + share * (self.sight.base[0] - foe.x), foe.y + share * (self.sight.base[1] - foe.y)
            free_s = np.full_like(grabs_s, distance(foe.at, at) / foe.top)
        sailed_m = foe.top * np.maximum(times_s - free_s[:, None], 0.0)
        off: Numbers = np.linalg.norm(points - np.array(at), axis=-1) - self.sight.reach
        found: Numbers = off - sailed_m - self._free_m
        if foe.tagged:
            wakes = np.abs(times_s - free_s[:, None]) < WAKES_S
            found = np.minimum(found, np.where(wakes, off - self._keep_m, np.inf))
        return found


def homeward(waters: Waters, boat: Boat, at: Point) -> Passage:
    """The best way from a point to the own side, for a boat that has the flag."""
    ways = _home_ways(waters.sight, at)
    rooms, long_m = _looked_at(waters, boat, ways, np.zeros(len(ways)), carries=True)
    best = _best(rooms, long_m)
    return Passage(float(rooms[best]), _points(ways[best]))


def outward(waters: Waters, boat: Boat) -> Passage:
    """The best way to where the flag is grabbed, its room being the least until the boat is home."""
    found = []
    for grab in _grabs(waters.sight):
        ways = _out_ways(waters.sight, boat.at, grab)
        rooms, long_m = _looked_at(waters, boat, ways, np.zeros(len(ways)), carries=False)
        out = _best(rooms, long_m)
        back = _home_ways(waters.sight, grab)
        back_rooms, back_m = _looked_at(waters, boat, back, np.full(len(back), long_m[out] / boat.top), carries=True)
        home = _best(back_rooms, back_m)
        room = float(min(rooms[out], back_rooms[home]))
        worth = ROOM_FOR_WAY * min(room, ENOUGH_M) - long_m[out] - back_m[home]
        found.append((worth, Passage(room, _points(ways[out]))))
    return max(found, key=lambda one: one[0])[1]


def _best(rooms: Numbers, long_m: Numbers) -> int:
    return int(np.argmax(ROOM_FOR_WAY * np.minimum(rooms, ENOUGH_M) - long_m))


def _grabs(sight: Sight) -> list[Point]:
    """Points in the field from which the flag can be grabbed."""
    reach_m, (width, height) = sight.reach - 1.0, sight.size
    angles = [2.0 * math.pi * k / GRABS for k in range(GRABS)]
    points = [(sight.goal[0] + reach_m * math.cos(a), sight.goal[1] + reach_m * math.sin(a)) for a in angles]
    return [(x, y) for x, y in points if 2.0 < x < width - 2.0 and 2.0 < y < height - 2.0]


def _bends(sight: Sight) -> Numbers:
    width = sight.base[0] - sight.line
    along = sight.line + np.array(ALONG_SHARES) * width
    return np.array([(x, share * sight.size[1]) for share in ACROSS_SHARES for x in along])


def _out_ways(sight: Sight, at: Point, grab: Point) -> Numbers:
    """Ways (W, 3, 2): straight, and with one bend."""
    bends = np.concatenate([[at], _bends(sight)])
    return np.stack([np.broadcast_to(at, bends.shape), bends, np.broadcast_to(grab, bends.shape)], axis=1)


def _home_ways(sight: Sight, at: Point) -> Numbers:
    """Ways (W, 3, 2) home: straight to a place at the line, and with a bend at its height."""
    ends = np.array([(sight.line - 1.0, share * sight.size[1]) for share in ACROSS_SHARES])
    bends = _bends(sight)
    bends, ends = np.concatenate([ends, bends]), np.concatenate([ends, np.repeat(ends, len(ALONG_SHARES), axis=0)])
    return np.stack([np.broadcast_to(at, bends.shape), bends, ends], axis=1)


def _looked_at(
    waters: Waters, boat: Boat, ways: Numbers, from_s: Numbers, carries: bool
) -> tuple[Numbers, Numbers]:
    """Room (W,) on ways (W, 3, 2) and their lengths, m."""
    legs_m = np.linalg.norm(np.diff(ways, axis=1), axis=-1)
    long_m = legs_m.sum(axis=1)
    gone_m = np.linspace(1.0 / LOOKS, 1.0, LOOKS) * long_m[:, None]
    first = np.clip(gone_m / np.maximum(legs_m[:, :1], 1e-9), 0.0, 1.0)[..., None]
    second = np.clip((gone_m - legs_m[:, :1]) / np.maximum(legs_m[:, 1:], 1e-9), 0.0, 1.0)[..., None]
    points = ways[:, None, 0] + first * (ways[:, 1] - ways[:, 0])[:, None] + second * (ways[:, 2] - ways[:, 1])[:, None]
    times_s = from_s[:, None] + gone_m / boat.top
    grabs_s = from_s if carries else from_s + long_m / boat.top
    return waters.room_m(points, times_s, grabs_s), long_m


def _points(way: Numbers) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in way[1:])
