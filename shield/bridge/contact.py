"""Boats seen from outside: opponents, and team-mates without a link of ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


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
        """The latest contact of each boat ever heard of."""

    def close(self) -> None:
        """Give its sockets back."""
