"""Ohto-Indep: stationary defence.

The paper: the boats hold where they start, near the base. There and in the presets that is a row across the own half.
Filled in: where a game starts boats elsewhere, they first drive to the places of that row, by least total distance, and
hold there for good.
"""

from __future__ import annotations

import math

from .catalogue import entrant
from .plane import STOP_MPS, Order, clip, distance, heading_to, wrap
from .play import EntrantTeam
from .posts import assign, row
from .sight import Point, Sight

ARRIVED_M = 2.0
DRIVEN_OFF = 0.6
"""Of the way between two posts: a boat that holds goes back to its post from there."""
COAST_S = 3.0
"""A boat that stops goes on for about its speed times this."""
SLOWING_S, SLOWEST = 20.0, 0.1
"""A boat this far from its post in time slows down, to no less than this share of its top speed: it has no brakes."""
ABEAM_RAD, CRAWL = math.radians(80.0), 0.3
"""Off a post by more than this a boat turns at this share of its top speed: at full speed it would circle the post."""


@entrant("ohto", "stationary defence: holds before its base (Ohto-Indep)", "Ohto-Indep")
class Ohto(EntrantTeam):
    """Holds at stations before the base."""

    name = "ohto"

    def begin(self, sight: Sight) -> None:
        """Choose each boat's station."""
        posts = row(sight)
        self._posts: list[Point] = [posts[number] for number in assign([boat.at for boat in sight.own], posts)]
        self._far_m = DRIVEN_OFF * sight.size[1] / (len(posts) + 1)
        self._moving = [True] * len(sight.own)

    def decide(self, sight: Sight) -> list[Order]:
        """Hold; drive back when the game drove a boat off."""
        return [self._order(sight, number) for number in range(len(sight.own))]

    def _order(self, sight: Sight, number: int) -> Order:
        boat, post = sight.own[number], self._posts[number]
        way_m = distance(boat.at, post)
        arrived_m = max(ARRIVED_M, COAST_S * math.hypot(*boat.velocity))
        self._moving[number] = way_m > (arrived_m if self._moving[number] else self._far_m)
        if not self._moving[number]:
            return STOP_MPS, boat.heading
        heading = heading_to(boat.at, post)
        if abs(wrap(heading - boat.heading)) > ABEAM_RAD:
            return CRAWL * boat.top, heading
        return clip(way_m / SLOWING_S, SLOWEST * boat.top, boat.top), heading
