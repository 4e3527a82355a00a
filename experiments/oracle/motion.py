"""What else decided how the boats of a record moved: a current that carried them all, commands that came late."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .boat import Array
from .errors import OracleError


@dataclass(frozen=True)
class Motion:
    """Physics of a record beside its boats.

    In the frame of the water boats move by their own equations and distances are the same, so that is where plans
    are searched. A late command changes nothing but the first state that it can change.

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
