"""The team: who does what in each phase."""

from __future__ import annotations

from steerclear.shield.exceptions import PolicyError

from ..catalogue import entrant
from ..plane import STOP_MPS, Order, distance, dock, go, heading_to
from ..play import EntrantTeam
from ..posts import arc
from ..sight import Boat, Sight
from .chart import Chart
from .raid import BAIT, DRAG, RUN, Phase, Raid

CHASE_M = 20.0
"""Intruders this near are met, m; all of them while the own flag is taken."""


@entrant(
    "undertow", "two boats draw the guard to the far corner, the third brings the flag home: for play with a shield"
)
class Undertow(EntrantTeam):
    """Raids in three parts, and tags between them."""

    name = "undertow"

    def begin(self, sight: Sight) -> None:
        """No raid yet.

        Raises:
            PolicyError: fewer than three boats.
        """
        if len(sight.own) < 3:
            raise PolicyError(f"entrant {self.name!r} needs three boats, the team has {len(sight.own)}; give it three")
        self._raid = Raid(sight)

    def decide(self, sight: Sight) -> list[Order]:
        """Each boat's part of the raid."""
        chart = self._raid.advance(sight)
        return [self._order(sight, chart, number) for number in range(len(sight.own))]

    def _order(self, sight: Sight, chart: Chart, number: int) -> Order:
        boat = sight.own[number]
        if boat.tagged:
            return STOP_MPS, boat.heading
        if boat.carries:
            at = dock(boat, sight) if boat.on_side else None
            return boat.top, heading_to(boat.at, chart.home(boat.at, up=number == RUN) if at is None else at)
        part = self._part(sight, chart, number) if self._raid.phase > Phase.GATHER else None
        return self._guarding(sight, chart, number) if part is None else part

    def _part(self, sight: Sight, chart: Chart, number: int) -> Order | None:
        """A boat's part in the raid; None where it has none now."""
        boat, phase = sight.own[number], self._raid.phase
        if number == BAIT:
            return None if self._raid.bait_taken else go(boat, chart.bait, 0.5)
        if number == DRAG:
            return go(boat, chart.posts[DRAG]) if phase < Phase.DRAG else steer(boat, chart.drag(boat.at))
        if number != RUN or any(mate.carries for mate in sight.own):
            return None
        if phase == Phase.RUN:
            return steer(boat, chart.run(boat.at))
        return None if sight.taken else go(boat, chart.door if phase == Phase.DRAG else chart.posts[RUN])

    def _guarding(self, sight: Sight, chart: Chart, number: int) -> Order:
        """To the nearest intruder, if no mate is nearer to it; else to the post."""
        boat = sight.own[number]
        intruders = [foe for foe in sight.foes if not foe.on_side and not foe.tagged]
        foe = min(intruders, key=lambda one: distance(one.at, boat.at), default=None)
        if foe is not None and boat.recharged and boat.on_side and (sight.taken or _near(boat, foe)):
            nearest = min((mate for mate in sight.own if not mate.tagged), key=lambda mate: distance(mate.at, foe.at))
            if nearest is boat:
                return go(boat, (min(foe.x, sight.line - 2.0), foe.y))
        return go(boat, chart.posts[number] if number <= RUN else arc(sight)[number])


def steer(boat: Boat, point: tuple[float, float]) -> Order:
    """Full speed towards a point."""
    return boat.top, heading_to(boat.at, point)


def _near(boat: Boat, foe: Boat) -> bool:
    return distance(boat.at, foe.at) < CHASE_M
