"""Ohto-Indep: stationary defence.

The paper: the boats hold where they start, near the base. Filled in: where a game starts boats elsewhere in their half,
they first drive to stations on the grab radius before their flag, the nearest ones, and hold there for good.
"""

from __future__ import annotations

from .catalogue import entrant
from .plane import STOP_MPS, Order, distance, go
from .play import EntrantTeam
from .posts import arc, assign
from .sight import Point, Sight

ARRIVED_M, DRIVEN_OFF_M = 2.0, 6.0


@entrant("ohto", "stationary defence: holds before its base (Ohto-Indep)", "Ohto-Indep")
class Ohto(EntrantTeam):
    """Holds at stations before the base."""

    name = "ohto"

    def begin(self, sight: Sight) -> None:
        """Choose the stations: where the boats are if that is near the base, else on the arc before it."""
        near = [distance(boat.at, sight.home) <= 2.0 * sight.reach for boat in sight.own]
        posts = arc(sight)
        if all(near):
            self._posts: list[Point] = [boat.at for boat in sight.own]
        else:
            self._posts = [posts[number] for number in assign([boat.at for boat in sight.own], posts)]
        self._moving = [True] * len(sight.own)

    def decide(self, sight: Sight) -> list[Order]:
        """Hold; drive back when the game drove a boat off."""
        return [self._order(sight, number) for number in range(len(sight.own))]

    def _order(self, sight: Sight, number: int) -> Order:
        boat, post = sight.own[number], self._posts[number]
        way_m = distance(boat.at, post)
        self._moving[number] = way_m > (ARRIVED_M if self._moving[number] else DRIVEN_OFF_M)
        return go(boat, post) if self._moving[number] else (STOP_MPS, boat.heading)
