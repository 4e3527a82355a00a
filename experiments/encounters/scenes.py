"""Encounters to be played: where boats start, what steers them, and the conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, IntArray

from ..play.conditions import MOST as MOST_CONDITIONS
from ..play.conditions import check_values

DT_S = 0.1
RADIUS_M = 2.5
MOST = {"radius_m": 20.0, **MOST_CONDITIONS}


@dataclass(frozen=True)
class Conditions:
    """What holds for all encounters of a run.

    Attributes:
        radius_m: separation to keep, m.
        delay_s: time from a command of an own boat to its effect, s.
        noise_m: bound on the error of every position that the own team sees, m.
        current_mps: speed of the current, m/s; each encounter draws its direction, of which no guard is told.

    Raises:
        ConfigError: a value that is not finite, negative or beyond `MOST`.
    """

    radius_m: float = RADIUS_M
    delay_s: float = 0.0
    noise_m: float = 0.0
    current_mps: float = 0.0

    def __post_init__(self) -> None:
        check_values(self.as_dict(), MOST)
        if not self.radius_m > 0.0:
            raise ConfigError(f"radius_m is {self.radius_m}; give a radius above 0")

    def as_dict(self) -> dict[str, float]:
        """The values by name."""
        return asdict(self)


@dataclass(frozen=True)
class Scenes:
    """A batch of B games of the same fleet; the own boats are team 0 and come first.

    Attributes:
        family: name of their family.
        platforms: of the n boats.
        team: (n,) 0 own, 1 other.
        state: (B, n, N_STATE) at the start.
        script: (B, n, N_SCRIPT) what steers each boat.
        goals: (B, n, G, 2) m.
        current: (B, 2) direction of the current, unit length.
        noise_seed: (B,) uint64, of each game's position errors.
        number: (B,) encounter a game belongs to; games of the same number are variants, of which the worst counts.
        field: (xmin, ymin, xmax, ymax) m, or None for open water.
        length_s: how long they last, s.
    """

    family: str
    platforms: tuple[str, ...]
    team: IntArray
    state: Array
    script: Array
    goals: Array
    current: Array
    noise_seed: NDArray[np.uint64]
    number: IntArray
    field: tuple[float, float, float, float] | None
    length_s: float

    @property
    def games(self) -> int:
        """Number of games B."""
        return len(self.state)

    @property
    def steps(self) -> int:
        """Steps of each game."""
        return round(self.length_s / DT_S)

    @property
    def own(self) -> NDArray[np.bool_]:
        """(n,) boats of the own team."""
        return np.asarray(self.team == 0)

    def take(self, games: Sequence[int] | IntArray) -> Scenes:
        """Some of the games."""
        chosen = np.asarray(games, dtype=np.int64)
        names = ("state", "script", "goals", "current", "noise_seed", "number")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def join(scenes: Sequence[Scenes]) -> Scenes:
    """Put batches of the same fleet into one."""
    first = scenes[0]
    names = ("state", "script", "goals", "current", "noise_seed", "number")
    return replace(first, **{name: np.concatenate([getattr(part, name) for part in scenes]) for name in names})
