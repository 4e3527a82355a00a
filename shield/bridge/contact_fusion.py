"""Which fixes of a boat are believed, and what must be believed when several sources tell of it.

Sources that agree about a boat tell one story: its surest fix counts, with an error that covers what the others say.
Sources that contradict each other tell several, and each may be the true one, the newest no more than another: the boat
is kept clear of wherever one of them has it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .messages import Contact

FARTHEST_M = 1e5
"""Positions farther from the field's corner than this are faults."""
SPEED_SHARE, SPEED_MORE_MPS = 2.0, 1.0
"""Speeds beyond this share of the platform's top plus this much are faults: current and wind give less."""
JUMP_M = 3.0
"""Differences from where the boat must be that no receiver's noise explains, m."""
BELIEVED_AFTER_S = 2.0
"""A new place told consistently for this long is believed, s, if nobody else sees the boat elsewhere."""
MOVED_M, FROZEN_M = 0.05, 0.6
"""A position that moved less than the first while the boat's speed says it ran the second is frozen, m."""
UNDER_WAY_MPS = 0.2
"""Slower boats may well stay where they are: noise of the speed is no way run."""

EARLY_S = 0.1
"""Contacts fixed later than now by more than this are faults of a clock."""
MOST_SOURCES, MOST_STORIES = 32, 3
"""Sources remembered of a boat; places kept clear of for it: when more are told nobody knows where it is."""
VAGUE_M = 10.0
"""A place known no better than this cannot be kept clear of: it widens no surer one; as a rival it is one too many."""


def _apart(one: Contact, other: Contact) -> tuple[float, float]:
    """How far apart two have a boat, m, the older one run straight on, and how much older it is, s."""
    older, newer = sorted((one, other), key=lambda contact: contact.fixed_s)
    seconds = newer.fixed_s - older.fixed_s
    way = older.speed_mps * seconds
    x_m = older.position_m[0] + way * math.sin(older.heading_rad)
    y_m = older.position_m[1] + way * math.cos(older.heading_rad)
    return math.hypot(newer.position_m[0] - x_m, newer.position_m[1] - y_m), seconds


class Gate:
    """Lets fixes of one boat by one source through, or says why not.

    A jump is refused at first. A boat that keeps saying the same new place is believed in the end: receivers do settle
    on a better fix, and a track that never comes back would be worse.

    Args:
        fastest_mps: top speed of its platform, m/s.
    """

    def __init__(self, fastest_mps: float) -> None:
        self._fastest = SPEED_SHARE * fastest_mps + SPEED_MORE_MPS
        self._last: Contact | None = None
        self._still: Contact | None = None
        self._newest_s, self._run_m = -math.inf, 0.0
        self._doubted: Contact | None = None
        self._doubted_since_s = 0.0

    def refuse(self, fix: Contact, witness: Contact | None = None) -> str:
        """Why this fix is not taken; empty: it is taken.

        Args:
            fix: what is told.
            witness: where somebody else lately saw the boat; None: nobody did. It never refuses a fix that goes on
                from the last one taken: it may be the one that is wrong.
        """
        (x_m, y_m), speed_mps, last = fix.position_m, abs(fix.speed_mps), self._last
        if not np.isfinite((x_m, y_m, fix.heading_rad, speed_mps, fix.fixed_s)).all():
            return "a value is not finite"
        if math.hypot(x_m, y_m) > FARTHEST_M:
            return f"position ({x_m:.0f}, {y_m:.0f}) m is nowhere near the field"
        if speed_mps > self._fastest:
            return f"speed {fix.speed_mps:.1f} m/s is beyond the boat"
        if self._is_frozen(fix):
            return f"position frozen while it runs {speed_mps:.1f} m/s"
        elsewhere = witness is not None and _apart(witness, fix)[0] > JUMP_M + witness.error_m
        if elsewhere and witness is not None and self._doubted is not None:
            goes_on = last is not None and _apart(last, fix)[0] <= JUMP_M + witness.error_m
            if not goes_on:
                self._doubted, self._doubted_since_s = fix, fix.fixed_s
                return "position jumped, and the feed sees it elsewhere"
        if last is not None and not self._is_near(last, fix):
            if self._doubted is None or not self._is_near(self._doubted, fix):
                self._doubted_since_s = fix.fixed_s
            self._doubted = fix
            if fix.fixed_s - self._doubted_since_s < BELIEVED_AFTER_S:
                return f"position jumped {_apart(last, fix)[0]:.0f} m"
        self._last, self._doubted = fix, None
        return ""

    def _is_frozen(self, fix: Contact) -> bool:
        """Whether the position stays although the boat is under way; its time stamps may be fresh all the same."""
        still = self._still
        if still is None or math.dist(fix.position_m, still.position_m) > MOVED_M:
            self._still, self._run_m = fix, 0.0
        elif fix.fixed_s > self._newest_s and abs(fix.speed_mps) > UNDER_WAY_MPS:
            self._run_m += abs(fix.speed_mps) * min(fix.fixed_s - self._newest_s, 1.0)
        self._newest_s = max(self._newest_s, fix.fixed_s)
        return self._run_m > FROZEN_M

    def _is_near(self, before: Contact, fix: Contact) -> bool:
        """Whether the boat can have come from there, whatever it did on the way."""
        apart_m, seconds = _apart(before, fix)
        return apart_m <= JUMP_M + 2.0 * self._fastest * min(seconds, BELIEVED_AFTER_S)


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


class ContactFusion:
    """Where others say one boat is, by source, and what must be believed of all they say.

    Args:
        fastest_mps: top speed of its platform, m/s.
        max_age_s: who said something longer ago is silent, s.
        lost_after_s: what was said longer ago counts only where nobody said anything later, s.
    """

    def __init__(self, fastest_mps: float, max_age_s: float, lost_after_s: float) -> None:
        self._fastest_mps, self._max_age_s, self._lost_after_s = fastest_mps, max_age_s, lost_after_s
        self._gates: dict[str, Gate] = {}
        self._latest: dict[str, Contact] = {}

    def take(self, contact: Contact, now_s: float) -> str:
        """Take a contact in.

        Returns:
            Why it is not believed; empty: it is, or it is nothing new.
        """
        source, known = contact.source, self._latest.get(contact.source)
        if known is not None and contact.fixed_s <= known.fixed_s:
            return ""  # the same fix, or one that came late
        if not 0.0 <= contact.error_m < math.inf:
            return f"error {contact.error_m} m is no bound"
        if contact.fixed_s > now_s + EARLY_S:
            return f"fixed {contact.fixed_s - now_s:.1f} s in the future"
        if source not in self._gates:
            if len(self._gates) >= MOST_SOURCES:  # forget the one whose last word is oldest
                heard_s = {
                    name: self._latest[name].fixed_s if name in self._latest else -math.inf for name in self._gates
                }
                oldest = min(heard_s, key=heard_s.__getitem__)
                del self._gates[oldest]
                self._latest.pop(oldest, None)
            self._gates[source] = Gate(self._fastest_mps)
        text = self._gates[source].refuse(contact)
        if not text:
            self._latest[source] = replace(contact, fixed_s=min(contact.fixed_s, now_s))
        return text

    def view(self, now_s: float) -> View | None:
        """What must be believed now; None: nobody ever told of it."""
        ages = {source: now_s - contact.fixed_s for source, contact in self._latest.items()}
        lately = [source for source, age in ages.items() if age <= self._lost_after_s]
        lately = lately or sorted(ages, key=ages.__getitem__)[:1]
        if not lately:
            return None
        lately.sort(key=lambda source: ages[source] > self._max_age_s)  # who still speaks, and was heard first
        stories: list[list[Contact]] = []
        for contact in (self._latest[source] for source in lately):
            agreeing = [story for story in stories if self._agree(story[0], contact)]
            agreeing[0].append(contact) if agreeing else stories.append([contact])
        contact, *others = (self._surest(story, now_s) for story in stories)
        rivals = tuple(other for other in others if other.error_m <= VAGUE_M)[: MOST_STORIES - 1]
        return View(contact, rivals, _contradiction(contact, others), crowded=len(rivals) < len(others))

    def _agree(self, one: Contact, other: Contact) -> bool:
        apart_m, between_s = _apart(one, other)
        room_m = JUMP_M + one.error_m + other.error_m
        return apart_m <= room_m + self._fastest_mps * min(between_s, BELIEVED_AFTER_S)

    def _surest(self, story: list[Contact], now_s: float) -> Contact:
        """The surest contact of a story; where another's bound and its own exclude each other it covers both."""
        surest = min(story, key=lambda contact: contact.error_m + self._fastest_mps * (now_s - contact.fixed_s))
        error_m = surest.error_m
        for other in story:
            apart_m, between_s = _apart(surest, other)
            apart_m -= self._fastest_mps * between_s
            is_sure = between_s <= self._max_age_s and other.error_m <= VAGUE_M
            if is_sure and apart_m > surest.error_m + other.error_m:
                error_m = max(error_m, apart_m + other.error_m)
        return replace(surest, error_m=error_m)


def _contradiction(contact: Contact, others: list[Contact]) -> str:
    if not others:
        return ""
    names = [other.source if len(other.source) <= 20 else f"{other.source[:19]}…" for other in (contact, *others)]
    told = [
        f"{name} {_apart(contact, other)[0]:.0f} m from there" for name, other in zip(names[1:], others, strict=True)
    ]
    more = ", and others elsewhere" if len(told) >= MOST_STORIES else ""
    named = ", ".join(told[: MOST_STORIES - 1])
    return f"{names[0]} has it at one place, {named}{more}: find out who is wrong and end it"
