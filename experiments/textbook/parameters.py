"""Names of the filters and their gains: the winners of `sweep` where it was run, else common ones.

The sweep plays the families head_on, crossing_left, crossing_right and rammer_1 of the encounter suite, 60 encounters
each from one seed, with every candidate of a grid, and takes the gains with the fewest encounters breached at a
separation of 2.5 m, among these the fewest commands changed. That is in the filters' favour: a grid of up to 109
candidates, tried on the boats and the kinds of encounter they are then compared on (with other seeds).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from steerclear.shield.jit import Array

from .barriers import COLLISION_CONE, DISTANCE, EXPONENTIAL, PARABOLIC

KINDS = dict(velocity_cbf=DISTANCE, exponential_cbf=EXPONENTIAL, collision_cone=COLLISION_CONE, parabolic=PARABOLIC)
NAMES = tuple(KINDS)
INFLATION = 1.05
"""The parabolic filter's widening of the radius, s in its authors' library."""


@dataclass(frozen=True)
class Gains:
    """Gains of a filter.

    Attributes:
        alpha_per_s: rate of the class-K function of the row.
        first_per_s: a1 of the exponential barrier; alpha is then its a2.
        lambda_share: k_lambda of the parabolic barrier in units of sqrt(s^2 - 1)/R, s = `INFLATION`.
        mu_share: k_mu of the parabolic barrier in the same units.
    """

    alpha_per_s: float
    first_per_s: float = 1.0
    lambda_share: float = 0.1
    mu_share: float = 0.5

    def pack(self, radius_m: float) -> Array:
        """(N_GAIN,) for compiled code, at the radius to keep."""
        unit = math.sqrt(INFLATION**2 - 1.0) / radius_m
        return np.array([self.first_per_s, self.alpha_per_s, self.lambda_share * unit, self.mu_share * unit])


PUBLISHED = dict.fromkeys(NAMES, Gains(1.0))
"""Where a platform was not swept: rates of 1 per s; the parabola as in its authors' library."""

TUNED: dict[tuple[str, str], Gains] = {
    ("velocity_cbf", "heron"): Gains(0.025),
    ("exponential_cbf", "heron"): Gains(1.0, first_per_s=0.1),
    ("collision_cone", "heron"): Gains(3.0),
    ("parabolic", "heron"): Gains(0.05, lambda_share=0.5, mu_share=8.0),
    ("velocity_cbf", "surveyor"): Gains(0.05),
    ("exponential_cbf", "surveyor"): Gains(0.5, first_per_s=0.05),
    ("collision_cone", "surveyor"): Gains(5.0),
    ("parabolic", "surveyor"): Gains(1.0, lambda_share=0.5, mu_share=0.25),
}
"""By filter and platform, as `sweep` prints it."""


def gains_of(name: str, platform: str) -> Gains:
    """Gains of a filter for a platform, by their names."""
    return TUNED.get((name, platform), PUBLISHED[name])
