"""A way to the flag and home that passes opponents when they are elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..sight import Boat, Point, Sight
from .waters import Numbers, Waters

LOOKS = 40
"""Points of a way that are looked at."""
ACROSS_SHARES = (0.06, 0.18, 0.29, 0.4, 0.5, 0.6, 0.71, 0.82, 0.94)
"""Where a way may bend or come home, in shares of the field's height;"""
ALONG_SHARES = (0.12, 0.3, 0.5, 0.7)
"""and in shares of the way from the line to the flag."""
GRABS, INSIDE_M = 8, 2.0
"""Points round the flag at which it may be grabbed, and how far they are from the field's edge, m."""
ENOUGH_M = 6.0
"""More room than this is worth no longer way, m."""
ROOM_FIRST = 1000.0
"""So many metres of a way are worth a metre of room: the shorter of two that have as much is taken."""


@dataclass(frozen=True)
class Passage:
    """A way.

    Attributes:
        room_m: see `Waters.room_m`, the least until the boat is home.
        points: where it bends, and its end.
    """

    room_m: float
    points: tuple[Point, ...]


def outward(waters: Waters, boat: Boat) -> Passage:
    """The best way to where the flag is grabbed, on which a way home is thought of."""
    found = []
    for grab in _grabs(waters.sight):
        ways = _out_ways(waters.sight, boat.at, grab)
        rooms_m, long_m = _looked_at(waters, boat, ways, 0.0, carries=False)
        out = _best(rooms_m, long_m)
        back = _home_ways(waters.sight, grab)
        back_rooms_m, back_m = _looked_at(waters, boat, back, long_m[out] / boat.top, carries=True)
        home = _best(back_rooms_m, back_m)
        room_m = float(min(rooms_m[out], back_rooms_m[home]))
        worth = ROOM_FIRST * min(room_m, ENOUGH_M) - long_m[out] - back_m[home]
        found.append((worth, Passage(room_m, _points(ways[out]))))
    return max(found, key=lambda one: one[0])[1]


def homeward(waters: Waters, boat: Boat) -> Passage:
    """The best way to the own side for a boat that has the flag."""
    ways = _home_ways(waters.sight, boat.at)
    rooms_m, long_m = _looked_at(waters, boat, ways, 0.0, carries=True)
    best = _best(rooms_m, long_m)
    return Passage(float(rooms_m[best]), _points(ways[best]))


def _best(rooms_m: Numbers, long_m: Numbers) -> int:
    return int(np.argmax(ROOM_FIRST * np.minimum(rooms_m, ENOUGH_M) - long_m))


def _grabs(sight: Sight) -> list[Point]:
    """Points in the field from which the flag can be grabbed."""
    reach_m, (width, height) = sight.reach - 1.0, sight.size
    angles = [2.0 * math.pi * k / GRABS for k in range(GRABS)]
    points = [(sight.goal[0] + reach_m * math.cos(a), sight.goal[1] + reach_m * math.sin(a)) for a in angles]
    return [(x, y) for x, y in points if INSIDE_M < x < width - INSIDE_M and INSIDE_M < y < height - INSIDE_M]


def _bends(sight: Sight) -> Numbers:
    """Points (B, 2) at which ways bend, height by height."""
    along = sight.line + np.array(ALONG_SHARES) * (sight.base[0] - sight.line)
    return np.array([(x, share * sight.size[1]) for share in ACROSS_SHARES for x in along])


def _out_ways(sight: Sight, at: Point, grab: Point) -> Numbers:
    """Ways (W, 3, 2): straight, and with one bend."""
    bends = np.concatenate([[grab], _bends(sight)])
    return np.stack([np.broadcast_to(at, bends.shape), bends, np.broadcast_to(grab, bends.shape)], axis=1)


def _home_ways(sight: Sight, at: Point) -> Numbers:
    """Ways (W, 3, 2) home: straight to a place at the line, and with a bend at its height."""
    ends = np.array([(sight.line - 1.0, share * sight.size[1]) for share in ACROSS_SHARES])
    bends = np.concatenate([ends, _bends(sight)])
    ends = np.concatenate([ends, np.repeat(ends, len(ALONG_SHARES), axis=0)])
    return np.stack([np.broadcast_to(at, bends.shape), bends, ends], axis=1)


def _looked_at(waters: Waters, boat: Boat, ways: Numbers, from_s: float, carries: bool) -> tuple[Numbers, Numbers]:
    """Room (W,) on ways (W, 3, 2) that are begun after some time at full speed, and their lengths (W,), m."""
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
