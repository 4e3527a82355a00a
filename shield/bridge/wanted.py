"""What the loop shows a policy, and how it asks for the answer: never waiting for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..commands import Commands
from ..jit import Array


@dataclass(frozen=True)
class Snapshot:
    """The game as the loop sees it at one tick.

    Attributes:
        number: of the tick.
        taken_s: time of the tick on the loop's clock, s.
        seen: (n, 4) of all boats of the file in its order: x m, y m, heading deg clockwise from the y axis, speed m/s,
            run on to ``taken_s``; NaN: never seen.
        game: state of the game as the referee last sent it; empty: none yet.
        game_age_s: its age, s; inf: none yet.
    """

    number: int
    taken_s: float
    seen: Array
    game: Mapping[str, Any] = field(default_factory=dict)
    game_age_s: float = float("inf")


@dataclass(frozen=True)
class Answer:
    """The latest answer of a policy.

    Attributes:
        commands: absolute commands of all boats of the file in its order, NaN where it has none; None: none yet.
        age_s: time since the tick whose snapshot it answers, s; inf: none yet.
        fault: what is wrong with the policy now, for a person; empty: nothing.
    """

    commands: Commands | None = None
    age_s: float = float("inf")
    fault: str = ""


class WantedSource(Protocol):
    """A policy somewhere else; no call ever waits or raises."""

    def offer(self, snapshot: Snapshot) -> None:
        """Show it the latest snapshot; older ones it has not looked at are dropped."""

    def latest(self) -> Answer | tuple[Commands | None, float, str]:
        """Its latest answer."""

    def close(self) -> None:
        """End it."""
