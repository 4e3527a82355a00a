"""`Run`: a stretch of a log in which a boat was told where to go, on a grid of equal steps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

STEP_S = 0.1
"""Step of the grid and of the model, s."""
SHORTEST_S = 3.0
"""Shorter runs tell nothing."""
RATE_OVER_S = 0.2
"""Turn rates are taken over this time, s."""


class FitError(ConfigError):
    """A log cannot be read, contradicts itself, or says too little of the boat; one line that names the remedy."""


@dataclass(frozen=True)
class Run:
    """One run of k steps.

    Attributes:
        name: of the log it is from.
        begin_s: time of its first step in the log, s.
        seen: (k, 5) x m, y m, heading deg (unwrapped, clockwise from the y axis), speed m/s, turn rate deg/s.
        told: (k, 2) speed m/s and heading deg (unwrapped) commanded at each step.
    """

    name: str
    begin_s: float
    seen: Array = field(repr=False)
    told: Array = field(repr=False)

    @classmethod
    def of(cls, name: str, begin_s: float, seen: Array, told: Array) -> Run:
        """Build a run of x, y, heading, speed (k, 4) and of speed and heading told (k, 2), on the grid."""
        heading, wanted = np.unwrap(seen[:, 2], period=360.0), np.unwrap(told[:, 1], period=360.0)
        wanted = wanted + 360.0 * np.round((heading[0] - wanted[0]) / 360.0)
        back = max(1, round(RATE_OVER_S / STEP_S))
        padded = np.concatenate([np.full(back, heading[0]), heading])
        rates = (padded[back:] - padded[:-back]) / (back * STEP_S)
        whole = np.column_stack([seen[:, 0], seen[:, 1], heading, seen[:, 3], rates])
        return cls(name, begin_s, whole, np.column_stack([told[:, 0], wanted]))

    def part(self, begin: int, end: int) -> Run:
        """Take steps ``begin`` to ``end``, the last one left out."""
        return Run(self.name, self.begin_s + begin * STEP_S, self.seen[begin:end], self.told[begin:end])

    @property
    def seconds(self) -> float:
        """How long it is, s."""
        return len(self.seen) * STEP_S

    @property
    def kind(self) -> str:
        """What it shows most of: "turn", "faster", "slower" or "steady"."""
        turned = float(np.ptp(self.told[:, 1])) + float(np.abs(self.told[0, 1] - self.seen[0, 2]))
        if turned > 10.0:
            return "turn"
        gain = float(self.seen[-1, 3] - self.seen[0, 3])
        if abs(gain) < 0.3:
            return "steady"
        return "faster" if gain > 0.0 else "slower"
