"""`Told`: what each sender of the feed last said of each boat, in tables that nobody can fill."""

from __future__ import annotations

from dataclasses import dataclass

from .contact import Contact
from .feed_order import GONE_S

MAX_BOATS_TOLD = 256
MAX_SOURCES = 8
"""Senders kept of one boat; where more speak at once nobody can tell which of them to believe."""


@dataclass
class _Word:
    contact: Contact
    heard_s: float


class Told:
    """Contacts by boat and sender."""

    def __init__(self) -> None:
        self._words: dict[str, dict[str, _Word]] = {}
        self._crowded_s: dict[str, float] = {}

    def has_room(self, boat: str) -> bool:
        """Whether this boat may be told of: it is known, or not too many are."""
        return boat in self._words or len(self._words) < MAX_BOATS_TOLD

    def take(self, contact: Contact, now_s: float) -> None:
        """Keep what a sender says now; one too many takes the place of who is silent, else of who came last."""
        words = self._words.setdefault(contact.boat, {})
        if contact.source not in words and len(words) >= MAX_SOURCES:
            silent = min(words, key=lambda name: words[name].heard_s)
            if now_s - words[silent].heard_s >= GONE_S:
                del words[silent]
            else:
                self._crowded_s[contact.boat] = now_s
                del words[next(reversed(words))]
        words[contact.source] = _Word(contact, now_s)

    def contacts(self, now_s: float) -> tuple[Contact, ...]:
        """All of them; of each boat in the order its senders were first heard, but silent ones last."""
        told = []
        for words in self._words.values():
            silent = [word for word in words.values() if now_s - word.heard_s >= GONE_S]
            told += [word for word in words.values() if word not in silent] + silent
        return tuple(word.contact for word in told)

    def crowded(self, now_s: float) -> tuple[str, ...]:
        """Boats that more senders spoke of lately than are kept."""
        return tuple(boat for boat, at_s in self._crowded_s.items() if now_s - at_s < GONE_S)
