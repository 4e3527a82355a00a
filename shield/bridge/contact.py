"""Boats seen from outside: opponents, and team-mates without a link of ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

TELEMETRY = "telemetry"
"""Source of contacts that a boat's own link told; nobody else may call himself so."""


@dataclass(frozen=True)
class Contact:
    """The latest fix of one boat.

    Attributes:
        boat: its name.
        position_m: x, y in the field, m.
        heading_rad: clockwise from the field's y axis, rad.
        speed_mps: along the heading, m/s.
        fixed_s: time the fix was true on the receiver's clock, s: receipt less the age the sender declared.
        error_m: bound of the position's error, m.
        source: who said so.
    """

    boat: str
    position_m: tuple[float, float]
    heading_rad: float
    speed_mps: float
    fixed_s: float
    error_m: float
    source: str


class ContactSource(Protocol):
    """Gives the latest contacts; `read` never waits and never raises."""

    def read(self) -> Sequence[Contact]:
        """The latest contact of each boat by each of its sources; of one boat who was heard first comes first."""

    def close(self) -> None:
        """Give its sockets back."""


@dataclass(frozen=True)
class Alarm:
    """Something wrong with those who tell where boats are.

    Attributes:
        text: one line a person understands.
        boat: whose place is in doubt; empty: it is about a source as a whole.
        lost: whether nobody can know that place, so that it cannot be kept clear of.
    """

    text: str
    boat: str = ""
    lost: bool = False


@runtime_checkable
class Alarming(Protocol):
    """A source that can say that it is not to be trusted as it was."""

    def alarms(self) -> Sequence[Alarm]:
        """What is wrong now; never waits."""

    def rivals(self) -> Sequence[Contact]:
        """What those say who speak under the name of another; never waits."""


def alarms_of(source: object) -> tuple[Alarm, ...]:
    """The alarms of a source, if it has any to give."""
    return tuple(source.alarms()) if isinstance(source, Alarming) else ()


def heard_from(source: ContactSource) -> tuple[Contact, ...]:
    """All that a source has heard, whoever is right."""
    return (*source.read(), *(source.rivals() if isinstance(source, Alarming) else ()))
