"""What team-mates that another process commands were told to do, and telling the others what ours were told."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from ..exceptions import FeedError
from .feed_packets import Course
from .feed_sender import FeedSender
from .frame import FieldFrame
from .link import Sent
from .tick import Tick

LOG = logging.getLogger(__name__)

INTENT_AGE_S = 0.5
"""A team-mate told something longer ago than this is taken to hold its course, s: boats are told anew at every turn."""


@dataclass(frozen=True)
class Intent:
    """The last command of a boat, after its shield.

    Attributes:
        boat: its name.
        heading_rad: clockwise from the field's y axis, rad.
        speed_mps: m/s.
        told_s: when it was told, s on the receiver's clock: receipt less the age the sender declared.
        source: who said so.
    """

    boat: str
    heading_rad: float
    speed_mps: float
    told_s: float
    source: str


class IntentSource(Protocol):
    """Gives the latest intent of each boat; never waits."""

    def intents(self) -> Mapping[str, Intent]:
        """By name; what is old is in it too."""


def fresh(intent: Intent | None, now_s: float) -> Intent | None:
    """The intent, or None when there is none or it is too old to count on."""
    return None if intent is None or not now_s - intent.told_s <= INTENT_AGE_S else intent


class IntentPublisher:
    """A sink that tells the processes of team-mates at every turn what ours were told.

    Two boats that each take the other to hold its course may both give way to the same side; told of it in the same
    turn, the second one answers the first.

    Args:
        sender: sends it.
        frame: the field's.
    """

    def __init__(self, sender: FeedSender, frame: FieldFrame) -> None:
        self._sender = sender
        self._frame = frame
        self._told = False

    def take(self, tick: Tick) -> None:
        """Send what left in a tick."""
        courses = [course for name, sent in tick.sent.items() if (course := self._course(tick, name, sent)) is not None]
        try:
            if courses:
                self._sender.send_courses(courses)
        except FeedError as error:  # others then take the boat to hold its course
            if not self._told:
                LOG.warning("courses not published: %s", error)
            self._told = True

    def close(self) -> None:
        """Give the socket back."""
        self._sender.close()

    def _course(self, tick: Tick, name: str, sent: Sent) -> Course | None:
        """A command that left; a link's own stop has no heading and keeps the boat's."""
        heading = sent.heading_rad if math.isfinite(sent.heading_rad) else tick.readings[name].heading_rad
        if not (sent.delivered and math.isfinite(sent.speed_mps) and math.isfinite(heading)):
            return None
        true_deg = math.degrees(self._frame.heading_to_true_rad(heading))
        return Course(name, true_deg, sent.speed_mps, max(0.0, tick.sent_s - sent.sent_s))
