"""Which opponents stay at home to guard their flag."""

from __future__ import annotations

from ..sight import Sight
from .habits import Habits

COME_M = 3.0
"""An opponent so far beyond the dividing line is no guard, m."""
ROAMS_SHARE, QUIET_S = 0.3, 15.0
"""Nor is one so near to the line, in shares of the way from there to its flag, while none of ours has been within
`LURE_M` of the line or beyond it for so long, s: a guard goes back to its flag."""
LURE_M = 1.0


class Watch:
    """Who has been where.

    Attributes:
        habits: of the opponents.
        nobody: none stays at home, as was remembered of the game.
    """

    def __init__(self, sight: Sight) -> None:
        self.habits, self.nobody = Habits(len(sight.foes)), False
        self._left, self._numbers = set[int](), range(len(sight.foes))
        self._lured_s = sight.time

    def look(self, sight: Sight) -> bool:
        """Note who is where; whether habits were looked at."""
        if any(boat.x > sight.line - LURE_M for boat in sight.own):
            self._lured_s = sight.time
        near = sight.line - COME_M
        roams = sight.line + ROAMS_SHARE * (sight.base[0] - sight.line)
        quiet = sight.time - self._lured_s > QUIET_S
        self._left |= {
            n for n, foe in enumerate(sight.foes) if foe.x < near or (quiet and foe.x < roams and not foe.tagged)
        }
        return self.habits.look(sight)

    @property
    def unguarded(self) -> bool:
        """Whether every opponent has left its flag at some time, or keeps a habit whoever comes."""
        return self.nobody or all(number in self._left or self.habits.settled(number) for number in self._numbers)

    @property
    def timed(self) -> bool:
        """Whether some opponent keeps a habit."""
        return any(self.habits.settled(number) for number in self._numbers)
