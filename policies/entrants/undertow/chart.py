"""Where a raid leads: points of the field, with the bait at one edge or the other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..plane import clip
from ..sight import Point, Sight

BAIT_M, DRAG_M = 4.0, 3.0
"""How far from its edge the bait stands, and the second boat sails, m."""
CLEAR_M = 11.0
"""Distance from the ways of a raid that all opponents but the guard keep when it begins, m."""


@dataclass(frozen=True)
class Chart:
    """Points for a raid.

    Attributes:
        sight: the moment.
        upper: whether the bait is at the edge of large y; else everything is mirrored.
    """

    sight: Sight
    upper: bool

    def at(self, x: float, y: float) -> Point:
        """A point given with the bait at the upper edge, m."""
        return (x, y) if self.upper else (x, self.sight.size[1] - y)

    def height(self, point: Point) -> float:
        """Its y with the bait at the upper edge, m."""
        return self.at(*point)[1]

    @property
    def posts(self) -> list[Point]:
        """Where bait, second and third boat gather."""
        line, top = self.sight.line, self.sight.size[1]
        return [
            self.at(line - 2.0, top - BAIT_M),
            self.at(line - 2.0, DRAG_M + 1.0),
            self.at(line - 5.0, top - 10.0),
        ]

    @property
    def bait(self) -> Point:
        """Where the bait stands: just far enough beyond the line to be an intruder."""
        return self.at(self.sight.line + 1.5, self.sight.size[1] - BAIT_M)

    @property
    def door(self) -> Point:
        """Where the third boat waits for its turn."""
        return self.at(self.sight.line - 2.0, self.sight.size[1] - 8.0)

    def drag(self, at: Point) -> Point:
        """What the second boat steers for: along its edge, round the far corner, then the flag."""
        base = self.sight.base
        if at[0] < base[0]:
            return self.at(at[0] + 12.0, DRAG_M)
        return self.at(base[0] + 7.0, base[1] - 6.0) if self.height(at) < 10.0 else self.sight.goal

    def run(self, at: Point) -> Point:
        """What the third boat steers for: past the flag on the bait's side, to turn home away from the guard."""
        base = self.sight.base
        if at[0] < self.sight.line + 4.0:
            return self.at(at[0] + 8.0, base[1] + 7.0)
        return self.at(base[0] + 4.0, base[1] + 0.75 * self.sight.reach)

    def home(self, at: Point, up: bool) -> Point:
        """What a boat with the flag steers for: its own side, bearing off to the bait's edge or the other."""
        side = 1.0 if up == self.upper else -1.0
        return at[0] - 15.0, clip(at[1] + 4.0 * side, 2.5, self.sight.size[1] - 2.5)

    def is_open(self, others: list[Point]) -> bool:
        """Whether opponents other than the guard are clear of all ways."""
        line, top, base = self.sight.line, self.sight.size[1], self.sight.base
        ways = (
            (self.at(line + 1.0, DRAG_M), self.at(base[0] + 2.0, DRAG_M)),
            (self.at(line, top - BAIT_M), self.at(base[0] - 10.0, base[1] + 12.0)),
        )
        return all(off(place, *way) > CLEAR_M for place in others for way in ways)


def off(point: Point, a: Point, b: Point) -> float:
    """Distance of a point from the line between a and b, m."""
    along = b[0] - a[0], b[1] - a[1]
    share = ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / (along[0] ** 2 + along[1] ** 2)
    share = clip(share, 0.0, 1.0)
    return math.hypot(point[0] - a[0] - share * along[0], point[1] - a[1] - share * along[1])
