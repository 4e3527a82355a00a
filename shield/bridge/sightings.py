"""`Sightings`: where others say one boat is, by source, and what must be believed of all they say.

Sources that agree tell one story: its surest fix counts, with an error that covers what the others say. Sources that
contradict each other tell several, and each may be the true one, the newest no more than another: the boat is kept
clear of wherever one of them has it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from .contact import Contact
from .fleet_settings import ContactLimit
from .plausible import BELIEVED_AFTER_S, JUMP_M, Fix, Gate

EARLY_S = 0.1
"""Contacts fixed later than now by more than this are faults of a clock."""

MOST_SOURCES = 32
MOST_STORIES = 3
"""Places kept clear of for one boat; when more are told nobody knows where it is."""
VAGUE_M = 10.0
"""A place known no better than this cannot be kept clear of: it widens no surer one; as a rival it is one too many."""


@dataclass(frozen=True)
class View:
    """What must be believed of one boat.

    Attributes:
        contact: of the story told first by a source that still speaks.
        rivals: of the stories that contradict it.
        text: who contradicts whom, in words; empty: nobody.
        crowded: whether more is told than can be kept clear of.
    """

    contact: Contact
    rivals: tuple[Contact, ...] = ()
    text: str = ""
    crowded: bool = False


class Sightings:
    """The sources of one boat.

    Args:
        fastest_mps: top speed of its platform, m/s.
        limit: how old contacts may be.
    """

    def __init__(self, fastest_mps: float, limit: ContactLimit) -> None:
        self._fastest_mps = fastest_mps
        self._limit = limit
        self._gates: dict[str, Gate] = {}
        self._latest: dict[str, Contact] = {}

    def take(self, contact: Contact, now_s: float) -> str:
        """Take a contact in.

        Returns:
            Why it is not believed; empty: it is, or it is nothing new.
        """
        known = self._latest.get(contact.source)
        if known is not None and contact.fixed_s <= known.fixed_s:
            return ""  # the same fix, or one that came late
        if not 0.0 <= contact.error_m < math.inf:
            return f"error {contact.error_m} m is no bound"
        if contact.fixed_s > now_s + EARLY_S:
            return f"fixed {contact.fixed_s - now_s:.1f} s in the future"
        gate = self._gates.get(contact.source)
        if gate is None:
            self._make_room()
            gate = self._gates[contact.source] = Gate(self._fastest_mps)
        text = gate.refuse(_fix(contact))
        if not text:
            self._latest[contact.source] = replace(contact, fixed_s=min(contact.fixed_s, now_s))
        return text

    def view(self, now_s: float) -> View | None:
        """What must be believed now; None: nobody ever told of it."""
        stories = self._stories(now_s)
        if not stories:
            return None
        contact, *others = (self._told(story, now_s) for story in stories)
        rivals = tuple(other for other in others if other.error_m <= VAGUE_M)[: MOST_STORIES - 1]
        return View(contact, rivals, _words(contact, others), crowded=len(rivals) < len(others))

    def _make_room(self) -> None:
        """Forget the source whose last word is oldest."""
        if len(self._gates) >= MOST_SOURCES:
            oldest = min(self._gates, key=lambda name: _fixed_s(self._latest.get(name)))
            del self._gates[oldest]
            self._latest.pop(oldest, None)

    def _stories(self, now_s: float) -> list[list[Contact]]:
        """Groups of contacts that agree with the first of their group; who speaks and was heard first comes first."""
        ages = {source: now_s - contact.fixed_s for source, contact in self._latest.items()}
        lately = [source for source, age in ages.items() if age <= self._limit.lost_after_s]
        if not lately:
            lately = sorted(ages, key=lambda source: ages[source])[:1]
        lately.sort(key=lambda source: ages[source] > self._limit.max_age_s)
        stories: list[list[Contact]] = []
        for contact in (self._latest[source] for source in lately):
            for story in stories:
                if self._agree(story[0], contact):
                    story.append(contact)
                    break
            else:
                stories.append([contact])
        return stories

    def _agree(self, one: Contact, other: Contact) -> bool:
        apart_m, between_s = _apart(one, other)
        room_m = JUMP_M + one.error_m + other.error_m
        return apart_m <= room_m + self._fastest_mps * min(between_s, BELIEVED_AFTER_S)

    def _told(self, story: Sequence[Contact], now_s: float) -> Contact:
        """The surest contact of a story; where another's bound and its own exclude each other it covers both."""
        surest = min(story, key=lambda contact: contact.error_m + self._fastest_mps * (now_s - contact.fixed_s))
        error_m = surest.error_m
        for other in story:
            apart_m, between_s = _apart(surest, other)
            if between_s <= self._limit.max_age_s and other.error_m <= VAGUE_M:
                apart_m -= self._fastest_mps * between_s
                if apart_m > surest.error_m + other.error_m:
                    error_m = max(error_m, apart_m + other.error_m)
        return replace(surest, error_m=error_m)


def _fix(contact: Contact) -> Fix:
    return Fix(*contact.position_m, contact.heading_rad, contact.speed_mps, contact.fixed_s, contact.error_m)


def _fixed_s(contact: Contact | None) -> float:
    return -math.inf if contact is None else contact.fixed_s


def _apart(one: Contact, other: Contact) -> tuple[float, float]:
    """How far apart two have the boat, m, the older one run on, and how much older it is, s."""
    older, newer = sorted((_fix(one), _fix(other)), key=lambda fix: fix.fixed_s)
    x_m, y_m = older.after(newer.fixed_s)
    return math.hypot(newer.x_m - x_m, newer.y_m - y_m), newer.fixed_s - older.fixed_s


def _words(contact: Contact, others: Sequence[Contact]) -> str:
    if not others:
        return ""
    told = [f"{_short(other.source)} {_apart(contact, other)[0]:.0f} m from there" for other in others]
    more = ", and others elsewhere" if len(told) >= MOST_STORIES else ""
    named = ", ".join(told[: MOST_STORIES - 1])
    return f"{_short(contact.source)} has it at one place, {named}{more}: find out who is wrong and end it"


def _short(source: str) -> str:
    return source if len(source) <= 20 else f"{source[:19]}…"
