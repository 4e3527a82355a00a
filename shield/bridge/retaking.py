"""`Retaking`: boats that somebody took from us are taken back when the operator asks, and never otherwise."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable, Mapping

from ..exceptions import BridgeError
from .link import BoatReading, Link
from .tick import Action

LOG = logging.getLogger(__name__)

WITHIN_S = 6.0
"""How long the autopilot is asked for, s: a pilot who takes it again meanwhile is not fought for longer."""

TOLD_S = 10.0
"""What came of it is shown for so long, s."""


class Retaking:
    """Asks boats for mode and arming beside the loop, which never waits.

    Args:
        links: of the boats this process commands.
    """

    def __init__(self, links: Mapping[str, Link]) -> None:
        self._links = links
        self._threads: dict[str, threading.Thread] = {}
        self._off = threading.Event()
        self._told: dict[str, tuple[float, str]] = {}
        self._ended: dict[str, str] = {}

    def look(
        self, requests: Iterable[tuple[str, str]], readings: Mapping[str, BoatReading], now_s: float, why_not: str = ""
    ) -> None:
        """Begin what is asked for.

        Args:
            requests: boats, and who asked.
            readings: of own boats; one that obeys needs nothing.
            now_s: time, s.
            why_not: why boats are not to be taken back now; what is under way is called off. Empty: they may be.
        """
        if why_not:
            self._off.set()
            self._told |= {boat: (now_s, f"{boat} is not taken back: {why_not}") for boat, _ in requests}
            requests = ()
        elif self._off.is_set():
            self._off = threading.Event()  # what was called off stays so: it has the old one
        for boat, by in requests:
            if boat not in self._links or readings[boat].ready:
                self._told[boat] = (
                    now_s,
                    f"{boat} need not be taken back: it "
                    + ("obeys" if boat in self._links else "is not commanded here"),
                )
            elif boat not in self._threads:
                self._told[boat] = now_s, f"{boat} is being taken back, asked for by {by}"
                self._threads[boat] = threading.Thread(
                    target=self._take, args=(boat, self._off), name=f"take {boat}", daemon=True
                )
                self._threads[boat].start()
        self._finish(now_s)

    def actions(self, now_s: float) -> tuple[Action, ...]:
        """What is under way, and what came of it lately, for the record and the display."""
        self._told = {
            boat: told for boat, told in self._told.items() if boat in self._threads or now_s - told[0] <= TOLD_S
        }
        return tuple(Action(boat, "take_back", "none", text) for boat, (_, text) in self._told.items())

    def close(self) -> None:
        """Call off what is under way, and wait for it."""
        self._off.set()
        for thread in self._threads.values():
            thread.join(2.0 * WITHIN_S)

    def _take(self, boat: str, off: threading.Event) -> None:
        try:
            self._links[boat].prepare(WITHIN_S, off.is_set)
            text = f"{boat} is taken back and obeys"
        except BridgeError as error:
            text = f"not taken back: {error}"
        LOG.warning("%s", text)
        self._ended[boat] = text

    def _finish(self, now_s: float) -> None:
        for boat in [boat for boat, thread in self._threads.items() if not thread.is_alive()]:
            del self._threads[boat]
            self._told[boat] = now_s, self._ended.pop(boat, f"{boat}: not taken back, see the log")
