"""The team: who does what in each phase."""

from __future__ import annotations

from steerclear.shield.exceptions import PolicyError

from ..catalogue import entrant
from ..plane import STOP_MPS, Order
from ..play import EntrantTeam
from ..sight import Sight
from .aims import aim_of
from .raid import Raid


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
        return [
            (STOP_MPS, boat.heading) if boat.tagged else aim_of(self._raid, sight, chart, number).order(boat)
            for number, boat in enumerate(sight.own)
        ]
