"""Scripted play over Crowley-BU-LL's options: the demonstrator to clone where there are no people's demonstrations."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from ..demonstrator import row_of
from ..options import OPTIONS, Choice, next_option, target
from ..plane import Order, distance
from ..play import EntrantTeam
from ..sight import Sight

EVERY_S = 1.0
"""Time between looks, s."""
THREAT_M = 40.0


class OptionPlayer(EntrantTeam):
    """Chooses an option for each boat once a second; subclasses say which in `wish`."""

    def begin(self, sight: Sight) -> None:
        """All guard, until the first look."""
        self._next_s = sight.time
        self._choices = [Choice("guard", sight.time) for _ in sight.own]

    def decide(self, sight: Sight) -> list[Order]:
        """Choose where it is time, and follow."""
        if sight.time >= self._next_s - 1e-9:
            self._next_s = sight.time + EVERY_S
            self.look_round(sight)
        for number, choice in enumerate(self._choices):
            if choice.ended(sight, number):
                self._choices[number] = Choice(next_option(sight, number, "guard"), sight.time)
        return [OPTIONS[choice.option].steer(sight, number) for number, choice in enumerate(self._choices)]

    def look_round(self, sight: Sight) -> None:
        """Choose for every boat."""
        for number, choice in enumerate(self._choices):
            name = next_option(sight, number, self.wish(sight, number))
            if name != choice.option:
                self._choices[number] = Choice(name, sight.time)

    @abstractmethod
    def wish(self, sight: Sight, number: int) -> str:
        """The option a boat wishes for."""


class Teacher(OptionPlayer):
    """Boat by boat: home with the flag, off a foe that presses, tag an intruder who comes near, else flank or attack.

    Attributes:
        rows: what it chose at what sight, see `demonstrator.row_of`.
    """

    name = "teacher"

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[dict[str, Any]] = []

    def look_round(self, sight: Sight) -> None:
        """Choose, and keep what was chosen."""
        super().look_round(sight)
        self.rows += [row_of(sight, number, choice, True) for number, choice in enumerate(self._choices)]

    def wish(self, sight: Sight, number: int) -> str:
        """See the class."""
        boat = sight.own[number]
        if boat.carries:
            return "retreat"
        foe = target(sight, number)
        if foe is not None and boat.recharged and boat.on_side and _nearest(sight, number, foe):
            return "tag"
        return "attack" if boat.y > 0.5 * sight.size[1] or boat.x > sight.line else "flank"


def _nearest(sight: Sight, number: int, foe: Any) -> bool:
    """Whether the boat is the nearest free own one to a foe that has come near."""
    ways = [distance(boat.at, foe.at) if not boat.tagged else 1e9 for boat in sight.own]
    return ways[number] == min(ways) and ways[number] < THREAT_M
