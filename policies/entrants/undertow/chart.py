"""Where a raid leads: points of the field, with the bait at one edge or the other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..plane import clip
from ..sight import Boat, Point, Sight
from .shape import SCRIPTED, Shape
from .way import slack_m

GRABS_DEG = (0.0, 30.0, 60.0)
"""Where a boat that sails alone may grab: round the flag, from before it towards its edge."""

WAIT_SHARES = (0.15, 0.5, 0.85, 0.5)
"""Where a boat that waits for a passage does so, in shares of the field's height."""


@dataclass(frozen=True)
class Chart:
    """Points for a raid.

    Attributes:
        sight: the moment.
        upper: whether the bait is at the edge of large y; else everything is mirrored.
        shape: its numbers.
    """

    sight: Sight
    upper: bool
    shape: Shape = SCRIPTED

    def at(self, x: float, y: float) -> Point:
        """A point given with the bait at the upper edge, m."""
        return (x, y) if self.upper else (x, self.sight.size[1] - y)

    def height(self, point: Point) -> float:
        """Its y with the bait at the upper edge, m."""
        return self.at(*point)[1]

    @property
    def posts(self) -> list[Point]:
        """Where bait, second and third boat gather."""
        line, top, shape = self.sight.line, self.sight.size[1], self.shape
        return [
            self.at(line - 2.0, top - shape.bait_m),
            self.at(line - 2.0, shape.drag_m + 1.0),
            self.at(line - shape.wait_x_m, top - shape.wait_m),
        ]

    @property
    def bait(self) -> Point:
        """Where the bait stands: just far enough beyond the line to be an intruder."""
        return self.at(self.sight.line + self.shape.bait_x_m, self.sight.size[1] - self.shape.bait_m)

    @property
    def door(self) -> Point:
        """Where the third boat waits for its turn."""
        return self.at(self.sight.line - self.shape.door_x_m, self.sight.size[1] - self.shape.door_m)

    def drag(self, at: Point) -> Point:
        """What the second boat steers for: along its edge, round the far corner, then the flag."""
        base, shape = self.sight.base, self.shape
        if at[0] < base[0] - shape.corner_x_m:
            return self.at(at[0] + 12.0, shape.drag_m)
        if self.height(at) < shape.turned_m:
            return self.at(base[0] + shape.turn_x_m, base[1] - shape.turn_m)
        return self.sight.goal

    def run(self, at: Point) -> Point:
        """What the third boat steers for: past the flag on the bait's side, to turn home away from the guard."""
        base, shape = self.sight.base, self.shape
        if at[0] < self.sight.line + shape.run_x_m:
            return self.at(at[0] + 8.0, base[1] + shape.run_m)
        return self.at(base[0] + shape.past_x_m, base[1] + shape.past_m)

    @property
    def edge(self) -> Point:
        """Where the third boat waits while no opponent stays at home."""
        return self.at(self.sight.line - 2.0, self.sight.size[1] - self.shape.edge_m)

    def wait(self, place: int) -> Point:
        """Where the third boat waits for a passage: in turn at one edge, in the middle and at the other."""
        return self.sight.line - 2.0, WAIT_SHARES[place % len(WAIT_SHARES)] * self.sight.size[1]

    def dash(self, boat: Boat) -> tuple[Point, float]:
        """Where a boat that sails alone grabs the flag, and by how much opponents would miss it, m."""
        (x, y), reach_m, height_m = self.sight.base, self.sight.reach - 1.0, self.sight.size[1]
        found = []
        for angle in map(math.radians, GRABS_DEG):
            up_m = reach_m * math.sin(angle)
            grab = self.at(x - reach_m * math.cos(angle), y + up_m)
            home = self.at(self.sight.line - 0.5, min(y + up_m + 6.0, height_m - 2.5))
            found.append((slack_m(self.sight, boat, grab, home), grab))
        slack, grab = max(found)
        return grab, slack

    def home(self, at: Point, up: bool) -> Point:
        """What a boat with the flag steers for: its own side, bearing off to the bait's edge or the other."""
        off_m = self.shape.home_m if up else -self.shape.drag_home_m
        return at[0] - 15.0, clip(at[1] + (off_m if self.upper else -off_m), 2.5, self.sight.size[1] - 2.5)

    def is_open(self, others: list[Point], clear_m: float) -> bool:
        """Whether opponents other than the guard are so clear of all ways, m."""
        line, top, base, shape = self.sight.line, self.sight.size[1], self.sight.base, self.shape
        ways = (
            (self.at(line + 1.0, shape.drag_m), self.at(base[0] + 2.0, shape.drag_m)),
            (self.at(line, top - shape.bait_m), self.at(base[0] - 10.0, base[1] + 12.0)),
        )
        return all(off(place, *way) > clear_m for place in others for way in ways)


def off(point: Point, a: Point, b: Point) -> float:
    """Distance of a point from the line between a and b, m."""
    along = b[0] - a[0], b[1] - a[1]
    share = ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / (along[0] ** 2 + along[1] ** 2)
    share = clip(share, 0.0, 1.0)
    return math.hypot(point[0] - a[0] - share * along[0], point[1] - a[1] - share * along[1])
