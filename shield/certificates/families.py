"""The certificates by name: which escape manoeuvres they look at.

A certificate of this kind is a family of manoeuvres; h is as in `manoeuvre`. Each row of a family is
(side, turn deg, speed), side 1 clockwise or -1, speed a fraction of top speed or `COMMANDED`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..jit import Array
from ..platforms import Platform
from ..platforms.limits import Limits, limits_of
from .assign import COMMANDED

TURNS_DEG = tuple(15.0 * k for k in range(1, 13))

REACTION_S = 4.0
"""Time beyond a half turn over which a turning escape is followed, s."""

LONGEST_HUNT_S = 60.0
"""Longest time over which a hunting opponent is followed, s."""


@dataclass(frozen=True)
class Certificate:
    """A family of escape manoeuvres with its horizon.

    Attributes:
        name: its name in settings.
        summary: what h means, one line.
        plans: (m, 3) rows of side, turn deg, speed.
        braking: whether the horizon is the stopping time rather than the time of a turn.
        hunters: whether opponents are granted a turn against us.
    """

    name: str
    summary: str
    plans: Array
    braking: bool
    hunters: bool

    def horizon_s(self, platform: Platform, dt_s: float) -> float:
        """Time over which the manoeuvres are followed, s."""
        limits = limits_of(platform, dt_s)
        return limits.stop_s + 1.0 if self.braking else limits.half_turn_s + REACTION_S

    def hunt_s(self, limits: Limits) -> float:
        """Time over which hunting opponents are followed, s: a boat outruns them only once it is up to speed again."""
        regain_s = limits.top_speed_mps / max(limits.acceleration_mps2, 1e-6)
        return min(LONGEST_HUNT_S, limits.half_turn_s + REACTION_S + regain_s)


def _turning_family() -> Array:
    rows = [(1.0, 0.0, COMMANDED)]
    for turn in TURNS_DEG:
        rows += [(1.0, turn, 1.0), (-1.0, turn, 1.0)]
    rows += [(1.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
    return np.array(rows)


BRAKING = Certificate(
    "braking",
    "distance left after stopping straight ahead while the others hold their course (the textbook form)",
    np.array([(1.0, 0.0, 0.0)]),
    braking=True,
    hunters=False,
)

TURNING_CIRCLE = Certificate(
    "turning_circle",
    "distance kept on the best turning circle, either side, any exit; opponents may hunt with their granted share",
    _turning_family(),
    braking=False,
    hunters=True,
)

CERTIFICATES = {certificate.name: certificate for certificate in (TURNING_CIRCLE, BRAKING)}
