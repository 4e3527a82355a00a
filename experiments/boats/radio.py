"""The radio between a boat and its commander: loss, delay and order of packets, one direction."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator

import numpy as np

from .settings import RadioSettings

Bend = Callable[[bytes], list[tuple[float, bytes]]]
"""A fault: what becomes of a packet, as (further delay s, bytes)."""


class Radio:
    """Holds packets until they arrive.

    Args:
        settings: what happens to every packet.
        random: its random numbers.

    Attributes:
        bends: faults that act now, in order.
        lost: packets dropped so far.
    """

    def __init__(self, settings: RadioSettings, random: np.random.Generator) -> None:
        self._settings = settings
        self._random = random
        self._waiting: list[tuple[float, int, bytes]] = []
        self._number = 0
        self.bends: list[Bend] = []
        self.lost = 0

    def put(self, packet: bytes, now_s: float) -> None:
        """A packet leaves."""
        if self._settings.loss > 0.0 and self._random.random() < self._settings.loss:
            self.lost += 1
            return
        copies = [(0.0, packet)]
        for bend in self.bends:
            copies = [(late + more, bent) for late, data in copies for more, bent in bend(data)]
        self.lost += not copies
        for late, data in copies:
            delay = self._settings.delay_s + late
            if self._settings.jitter_s > 0.0:
                delay += self._settings.jitter_s * self._random.random()
            self._number += 1
            heapq.heappush(self._waiting, (now_s + delay, self._number, data))

    def take(self, now_s: float) -> Iterator[bytes]:
        """Packets that have arrived by now."""
        while self._waiting and self._waiting[0][0] <= now_s + 1e-9:
            yield heapq.heappop(self._waiting)[2]

    def clear(self) -> None:
        """Forget what is under way."""
        self._waiting.clear()
