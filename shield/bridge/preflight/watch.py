"""`Watch`: looks at all links for a while, once, for all checks that move no boat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from ..clock import Clock
from ..mavlink.vehicle import LinkHealth
from ..messages import BoatReading

WATCH_S = 5.0
LOOK_EVERY_S = 0.05


class Watched(Protocol):
    """A link as checks see it."""

    def read(self) -> BoatReading:
        """See `messages.Link`."""

    def learn(self, timeout_s: float) -> None:
        """Ask for what is not known yet."""

    def health(self) -> LinkHealth:
        """What it knows of itself."""


class Watch:
    """Readings and health of all links; taken when first asked for.

    Args:
        links: connected, by boat's name.
        clock: the loop's.
        seconds: how long.
    """

    def __init__(self, links: Mapping[str, Watched], clock: Clock, seconds: float = WATCH_S) -> None:
        self._links, self._clock, self._seconds = links, clock, seconds
        self._readings: dict[str, list[BoatReading]] = {}
        self._health: dict[str, LinkHealth] = {}

    def readings(self, boat: str) -> list[BoatReading]:
        """What that boat said, in order."""
        self._look()
        return self._readings[boat]

    def health(self, boat: str) -> LinkHealth:
        """Health of its link at the end."""
        self._look()
        return self._health[boat]

    def _look(self) -> None:
        if self._readings:
            return
        for link in self._links.values():
            link.learn(LOOK_EVERY_S * 60.0)
            link.read()  # what was refused before, while the boat came up, is not of this watch
        readings: dict[str, list[BoatReading]] = {name: [] for name in self._links}
        due = self._clock.now_s()
        for _ in range(round(self._seconds / LOOK_EVERY_S)):
            due += LOOK_EVERY_S
            self._clock.sleep_until(due)
            for name, link in self._links.items():
                readings[name].append(link.read())
        self._health = {name: link.health() for name, link in self._links.items()}
        self._readings = readings
