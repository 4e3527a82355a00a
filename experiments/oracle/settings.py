"""How far the analysis looks, how finely it searches, and what else moved the boats of a record."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from .boat_model import Array
from .verdict import OracleError


@dataclass(frozen=True)
class Level:
    """Fineness of a search.

    Attributes:
        width: most states kept per layer.
        position_m: states of one layer closer than this (and the next three) count as the same.
        heading_deg: see ``position_m``.
        speed_mps: see ``position_m``.
        thrust: see ``position_m``, percent.
        rudders: rudder choices, shares of full rudder.
        schedules: each a search of its own: lengths of the first choices, s; later ones are as the last.
    """

    width: int
    position_m: float
    heading_deg: float
    speed_mps: float
    thrust: float
    rudders: tuple[float, ...]
    schedules: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        numbers = [getattr(self, one.name) for one in fields(self) if one.name not in ("rudders", "schedules")]
        lengths_s = [length_s for first_s in self.schedules for length_s in first_s]
        sound = all(value > 0 for value in (*numbers, *lengths_s)) and self.schedules and all(self.schedules)
        if not (sound and self.rudders and all(-1 <= value <= 1 for value in self.rudders)):
            raise OracleError(f"a search level needs positive sizes and rudders within [-1, 1]; got {self}")


QUICK = Level(150, 0.5, 10.0, 0.25, 15.0, (-1.0, 0.0, 1.0), ((0.5, 0.5, 0.5, 1.0),))
SCHEDULES = ((0.5,), (0.1, 0.1, 0.1, 0.2, 0.2, 0.3), (*(0.1,) * 15, *(0.2,) * 5, 0.3))
"""Short choices catch the last moment, but differ by less than a cell on a slow boat; longer ones do not."""
FULL = Level(2000, 0.05, 2.0, 0.03, 3.0, (-1.0, -0.5, 0.0, 0.5, 1.0), SCHEDULES)


@dataclass(frozen=True)
class Settings:
    """Settings of a judgement.

    Attributes:
        look_back_s: T, how long before the breach own commands may begin to differ, s.
        settle_s: how long after the breach the radius must still be kept, s. A plan that is clear when the real pair
            came apart, but heads into the next contact, has avoided nothing; beyond a few seconds, however, the
            others' recorded tracks answer a boat that is no longer there. 5 s lets a heron turn through 180 deg.
        longest_s: a breach counts as over after this time, s, so that boats parked side by side for minutes can be
            judged in bounded time.
        quick: level tried first; what it finds is proof.
        full: level that must fail before a breach is called unavoidable.
    """

    look_back_s: float = 30.0
    settle_s: float = 5.0
    longest_s: float = 30.0
    quick: Level = QUICK
    full: Level = FULL

    def __post_init__(self) -> None:
        for name, low in (("look_back_s", 0.1), ("settle_s", 0.0), ("longest_s", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= low):
                raise OracleError(f"{name} must be a number of seconds, at least {low:g}; got {value}")

    def refined(self, times: int = 2) -> Settings:
        """Return settings whose full search is finer: cells smaller and width larger by ``times``."""
        full = self.full
        cells = {name: getattr(full, name) / times for name in ("position_m", "heading_deg", "speed_mps", "thrust")}
        return replace(self, full=replace(full, width=full.width * times**2, **cells))


@dataclass(frozen=True)
class Motion:
    """Physics of a record beside its boats.

    Attributes:
        current_mps: (east, north) speed at which the water carried every boat, m/s.
        delay_steps: of each boat, steps from a command to its effect; empty: all act at once.

    Raises:
        OracleError: a current that is not finite, or a delay that is not a number of steps.
    """

    current_mps: tuple[float, float] = (0.0, 0.0)
    delay_steps: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if len(self.current_mps) != 2 or not all(math.isfinite(speed) for speed in self.current_mps):
            raise OracleError(f"current_mps is {self.current_mps}; give two finite speeds, east and north")
        if not all(isinstance(steps, int | np.integer) and steps >= 0 for steps in self.delay_steps):
            raise OracleError(f"delay_steps is {self.delay_steps}; give a whole number of steps, 0 or more, per boat")

    def delay_of(self, boat: int, boats: int) -> int:
        """Steps from a boat's command to its effect.

        Raises:
            OracleError: there are delays, but not one per boat.
        """
        if not self.delay_steps:
            return 0
        if len(self.delay_steps) != boats:
            raise OracleError(f"delay_steps holds {len(self.delay_steps)} of {boats} boats; give one per boat")
        return int(self.delay_steps[boat])

    def way_m(self, states: int, dt_s: float) -> Array:
        """Way (states, 2) that the water has gone from the first state to each, m."""
        return np.arange(states)[:, None] * dt_s * np.array(self.current_mps)


AT_ONCE = Motion()
"""Still water and commands that act at once."""
DEFAULT = Settings()
