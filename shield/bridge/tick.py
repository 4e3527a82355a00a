"""`Tick`: everything one turn of the loop took in, decided and sent; what the black box and the dashboard get."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..commands import Commands
from ..decision import Decisions
from ..fleet import Fleet
from ..surroundings import Surroundings
from .contact import Contact
from .link import BoatReading, Sent


@dataclass(frozen=True)
class Action:
    """Something declared that took effect, for one boat or contact.

    Attributes:
        subject: name of the boat, contact, policy or link it is about.
        condition: what happened, such as "telemetry", "contact", "policy", "link", "override", "stop_all".
        response: what is done, such as "hold_course", "slow", "hold_station", "stop".
        text: one line a person understands.
    """

    subject: str
    condition: str
    response: str
    text: str


@dataclass(frozen=True)
class Tick:
    """One turn of the loop.

    Attributes:
        number: 0, 1, ... since the start.
        due_s, began_s, sent_s: when the turn was due, began and had sent its last command, s on the loop's clock.
        readings: of own boats, by name.
        contacts: of others, as received.
        fleet: what the shield was given; None when no fleet could be built (then all boats are told to stop).
        wanted: what the shield was given; rows in the fleet's order.
        surroundings: what the shield was given.
        decisions: the shield's answer, or None.
        shield_reset: whether `Shield.reset` was called before this decision.
        sent: what left, by boat.
        policy_age_s: age of the policy's answer, s; inf: none yet.
        actions: what was declared and took effect.
        game: state of the game as received, for the record.
    """

    number: int
    due_s: float
    began_s: float
    sent_s: float
    readings: Mapping[str, BoatReading]
    contacts: tuple[Contact, ...]
    fleet: Fleet | None
    wanted: Commands | None
    surroundings: Surroundings | None
    decisions: Decisions | None
    shield_reset: bool
    sent: Mapping[str, Sent]
    policy_age_s: float
    actions: tuple[Action, ...] = ()
    game: Mapping[str, Any] = field(default_factory=dict)


class TickSink(Protocol):
    """Gets every tick: the black box, the dashboard."""

    def take(self, tick: Tick) -> None:
        """Take one tick; never waits.

        Raises:
            BridgeError: ticks can no longer be kept (the disk is full, the writer died): the loop falls back as
                declared.
        """

    def close(self) -> None:
        """Finish what was begun."""
