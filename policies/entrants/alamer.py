"""Alamer-EJUST: stationary defence at the point of interception.

The paper: the boats hold near the base at the closest point of interception and turn to face the opponent. Filled in:
each boat takes one foe (the assignment of least total distance); its point is the one of the foe's straight way to the
flag, within ``REACHES`` grab radii of the flag, that is nearest to the boat; boats keep `GAP_M` from mates' points by
standing further round the flag; a boat turns to face at a crawl, since these boats turn only under thrust.
"""

from __future__ import annotations

import math

from .catalogue import entrant
from .plane import STOP_MPS, Order, ahead, clip, distance, go, heading_to, nearest_on_path, wrap
from .play import EntrantTeam
from .posts import GAP_M, assign
from .sight import Boat, Point, Sight

REACHES = 1.6
ARRIVED_M, LEFT_M = 1.0, 4.0
FACING_RAD = math.radians(30.0)
CRAWL = 0.1
"""Share of top speed at which a boat turns on the spot."""


@entrant("alamer", "stationary defence: holds at the point of interception and faces the foe (Alamer-EJUST)", "Alamer-EJUST")
class Alamer(EntrantTeam):
    """Holds at points of interception near the base."""

    name = "alamer"

    def begin(self, sight: Sight) -> None:
        """Nobody has arrived."""
        self._moving = [True] * len(sight.own)

    def decide(self, sight: Sight) -> list[Order]:
        """Go to the points, hold there, face the foes."""
        chosen = assign([boat.at for boat in sight.own], [foe.at for foe in sight.foes])
        foes = [sight.foes[max(number, 0)] for number in chosen]
        points = apart(sight, [interception(sight, boat, foe) for boat, foe in zip(sight.own, foes, strict=True)])
        return [self._order(number, boat, points[number], foes[number]) for number, boat in enumerate(sight.own)]

    def _order(self, number: int, boat: Boat, point: Point, foe: Boat) -> Order:
        way_m = distance(boat.at, point)
        self._moving[number] = way_m > (ARRIVED_M if self._moving[number] else LEFT_M)
        if self._moving[number]:
            return go(boat, point)
        facing = heading_to(boat.at, foe.at)
        return (CRAWL * boat.top if abs(wrap(facing - boat.heading)) > FACING_RAD else STOP_MPS), facing


def interception(sight: Sight, boat: Boat, foe: Boat) -> Point:
    """The point of a foe's way to the flag, not far from it, that is nearest to a boat."""
    towards = heading_to(sight.home, foe.at)
    inner, outer = sight.keepout + boat.radius + 1.0, REACHES * sight.reach
    far = clip(distance(sight.home, foe.at), inner, outer)
    x, y = nearest_on_path(boat.at, ahead(sight.home, towards, inner), ahead(sight.home, towards, far))
    return clip(x, 2.0, sight.line - 2.0), clip(y, 2.0, sight.size[1] - 2.0)


def apart(sight: Sight, points: list[Point]) -> list[Point]:
    """The same points, those too near to an earlier one moved round the flag."""
    kept: list[Point] = []
    for point in points:
        radius, heading = distance(sight.home, point), heading_to(sight.home, point)
        step = GAP_M / max(radius, 1.0)
        tries = [ahead(sight.home, heading + sign * k * step, radius) for k in range(4) for sign in (1.0, -1.0)]
        fits = [p for p in tries if all(distance(p, other) >= 0.9 * GAP_M for other in kept) and _inside(sight, p)]
        kept.append(fits[0] if fits else point)
    return kept


def _inside(sight: Sight, point: Point) -> bool:
    return 1.0 < point[0] < sight.line and 1.0 < point[1] < sight.size[1] - 1.0
