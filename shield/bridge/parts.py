"""What the loop works with: links, sources, policy, sinks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..surroundings import OPEN_WATER, Surroundings
from .contact import TELEMETRY, Contact, ContactSource
from .link import BoatReading, Link
from .tick import TickSink
from .wanted import WantedSource


class Flag(Protocol):
    """One team's flag."""

    @property
    def taken(self) -> bool:
        """Whether an opponent carries it."""


class GameState(Protocol):
    """The state of the game as a referee sent it."""

    @property
    def over(self) -> bool:
        """Whether the game has ended."""

    @property
    def flags(self) -> Sequence[Flag]:
        """The blue flag and the red one."""

    def as_dict(self) -> dict[str, Any]:
        """As the feed has it."""


class GameSource(Protocol):
    """Gives the latest state of the game; never waits."""

    def game(self) -> GameState | None:
        """None: none yet."""

    def game_age_s(self) -> float:
        """Its age, s; inf: none yet."""


@dataclass(frozen=True)
class Parts:
    """What the loop works with.

    Attributes:
        links: of the boats this process commands, connected and prepared.
        ears: links that are only listened to, of boats somebody else commands.
        contacts: other sources of positions.
        game: the referee's state of the game; None: none.
        grounds: static constraints of the game: obstacles, and the own flag's circle as ``stops``, see `water.Water`.
        policy: where wanted commands come from.
        sinks: get every tick; the black box among them.
    """

    links: Mapping[str, Link]
    policy: WantedSource
    ears: Mapping[str, Link] = field(default_factory=dict)
    contacts: Sequence[ContactSource] = ()
    game: GameSource | None = None
    grounds: Surroundings = OPEN_WATER
    sinks: Sequence[TickSink] = ()


def contact_of(reading: BoatReading, error_m: float) -> Contact | None:
    """A boat's own telemetry as a contact; None while something of it was never received."""
    values = (*reading.position_m, reading.heading_rad, reading.speed_mps, reading.age_s)
    if not np.isfinite(values).all():
        return None
    return Contact(
        boat=reading.boat,
        position_m=reading.position_m,
        heading_rad=reading.heading_rad,
        speed_mps=reading.speed_mps,
        fixed_s=reading.read_s - reading.age_s,
        error_m=error_m,
        source=TELEMETRY,
    )
