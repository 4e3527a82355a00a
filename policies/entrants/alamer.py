"""Alamer-EJUST: stationary defence at the point of interception.

The paper: the boats hold near the base at the closest point of interception and turn to face the opponent. Filled in: a
foe's point of interception lies on its straight way to the flag, `REACHES` grab radii before the flag (nearer when the
foe is); points too near to each other are moved round the flag; boats take points by least total distance, anew
every `ANEW_S`, and move when theirs lies further off than `LEFT_M`; a boat turns to face at a crawl, since these boats
turn only under thrust.
"""

from __future__ import annotations

import math

from .catalogue import entrant
from .plane import STOP_MPS, Order, ahead, clip, distance, go, heading_to, wrap
from .play import EntrantTeam
from .posts import GAP_M, assign
from .sight import Boat, Point, Sight

REACHES = 1.3
ANEW_S = 3.0
ARRIVED_M, LEFT_M = 2.0, 6.0
FACING_RAD = math.radians(45.0)
CRAWL = 0.1
"""Share of top speed at which a boat turns on the spot."""


@entrant(
    "alamer", "stationary defence: holds at the point of interception and faces the foe (Alamer-EJUST)", "Alamer-EJUST"
)
class Alamer(EntrantTeam):
    """Holds at points of interception near the base."""

    name = "alamer"

    def begin(self, sight: Sight) -> None:
        """Nobody has a point yet."""
        self._moving = [True] * len(sight.own)
        self._points: list[Point] = []
        self._until_s = -math.inf

    def decide(self, sight: Sight) -> list[Order]:
        """Go to the points, hold there, face the nearest foes."""
        if sight.time >= self._until_s:
            self._until_s = sight.time + ANEW_S
            points = apart(sight, [interception(sight, foe) for foe in sight.foes])
            chosen = assign([boat.at for boat in sight.own], points)
            self._points = [
                points[number] if number >= 0 else boat.at for boat, number in zip(sight.own, chosen, strict=True)
            ]
        return [self._order(sight, number, boat) for number, boat in enumerate(sight.own)]

    def _order(self, sight: Sight, number: int, boat: Boat) -> Order:
        point = self._points[number]
        way_m = distance(boat.at, point)
        self._moving[number] = way_m > (ARRIVED_M if self._moving[number] else LEFT_M)
        if self._moving[number]:
            return go(boat, point)
        foe = min(sight.foes, key=lambda foe: distance(boat.at, foe.at))
        facing = heading_to(boat.at, foe.at)
        return (CRAWL * boat.top if abs(wrap(facing - boat.heading)) > FACING_RAD else STOP_MPS), facing


def interception(sight: Sight, foe: Boat) -> Point:
    """The point of a foe's way to the flag at which it is waited for."""
    inner, outer = sight.keepout + foe.radius + 1.0, REACHES * sight.reach
    x, y = ahead(sight.home, heading_to(sight.home, foe.at), clip(distance(sight.home, foe.at), inner, outer))
    return clip(x, 2.0, sight.line - 2.0), clip(y, 2.0, sight.size[1] - 2.0)


def apart(sight: Sight, points: list[Point]) -> list[Point]:
    """The same points, those too near to an earlier one moved round the flag."""
    kept: list[Point] = []
    for point in points:
        radius, heading = distance(sight.home, point), heading_to(sight.home, point)
        step = GAP_M / max(radius, 1.0)
        tries = [ahead(sight.home, heading + sign * k * step, radius) for k in range(4) for sign in (1.0, -1.0)]
        fits = [p for p in tries if _inside(sight, p) and all(distance(p, other) >= 0.9 * GAP_M for other in kept)]
        kept.append(fits[0] if fits else point)
    return kept


def _inside(sight: Sight, point: Point) -> bool:
    return 1.0 < point[0] < sight.line and 1.0 < point[1] < sight.size[1] - 1.0
