"""The certificates by name: which backup manoeuvres they look at, and whether opponents are run through or looked up.

A certificate of this kind is a family of manoeuvres; h is as in `manoeuvre`. Each row of a family is
(side, turn deg, speed): side clockwise when > 0, its size the share of full rudder; speed a fraction of top speed or
`COMMANDED`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..jit import Array
from ..platforms import Platform
from ..platforms.limits import Limits, limits_of
from .candidates import COMMANDED

TURNS_DEG = tuple(15.0 * k for k in range(1, 13))

GENTLE_TURNS_DEG = (30.0, 90.0, 180.0)
GENTLE_SHARES = (0.75, 0.5, 0.25)
"""Turns and rudders that boats with a value table look at besides: a hard turn costs speed, and with it room."""

SLOWING_TURNS_DEG = (45.0, 90.0, 180.0)
SLOWING_SPEEDS = (0.5, 0.0)
"""Turns made at less than full speed, which boats that steer without thrust look at besides, see `Certificate.ways`."""

SLOW_TO_REGAIN_S = 5.0
"""Boats that take longer than this to be up to speed again are looked up under the certificate "auto".

What a boat can do against pursuers after it has lost its speed hangs on play too long to be run through well; nimble
boats are better run through, one manoeuvre against all pursuers at once.
"""

REACTION_S = 4.0
"""Time beyond a half turn over which a turning backup is followed, s."""

LONGEST_PURSUIT_S = 60.0
"""Longest time over which a pursuing opponent is followed, s."""


@dataclass(frozen=True)
class Certificate:
    """A family of backup manoeuvres with its horizon.

    Attributes:
        name: its name in settings.
        summary: what h means, one line.
        plans: (m, 3) rows of side, turn deg, speed.
        braking: whether the horizon is the stopping time rather than the time of a turn.
        pursuers: whether opponents are granted a turn against us.
        tables: which boats look opponents up in value tables: "none", "slow" ones, or "all".
        slowing: number of manoeuvres, the last ones, for boats that steer without thrust.
    """

    name: str
    summary: str
    plans: Array
    braking: bool
    pursuers: bool
    tables: str = "none"
    slowing: int = 0

    def horizon_s(self, platform: Platform, dt_s: float) -> float:
        """Time over which the manoeuvres are followed, s."""
        limits = limits_of(platform, dt_s)
        return limits.stop_s + 1.0 if self.braking else limits.half_turn_s + REACTION_S

    def ways(self, platform: Platform, with_table: bool) -> int:
        """Number of manoeuvres, the first ones, that a boat looks at.

        The last ones, ``slowing``, are for boats that turn whatever their thrust: others lose their rudder with it.
        """
        if platform.kind == "rate":
            return len(self.plans)
        tabled = len(self.plans) - self.slowing
        return tabled if with_table else int((np.abs(self.plans[:tabled, 0]) == 1.0).sum())

    def uses_table(self, limits: Limits) -> bool:
        """Whether a boat looks opponents up where there is a table."""
        slow = limits.top_speed_mps > SLOW_TO_REGAIN_S * limits.acceleration_mps2
        return self.tables == "all" or (self.tables == "slow" and slow)

    def pursuit_s(self, limits: Limits) -> float:
        """Time over which pursuing opponents are followed, s: a boat outruns them only once it is up to speed again."""
        regain_s = limits.top_speed_mps / max(limits.acceleration_mps2, 1e-6)
        return min(LONGEST_PURSUIT_S, limits.half_turn_s + REACTION_S + regain_s)


SLOWING = [(1.0, 0.0, 0.5)]
SLOWING += [(side, turn, v) for v in SLOWING_SPEEDS for turn in SLOWING_TURNS_DEG for side in (1.0, -1.0)]


def _turning_family(gentle: bool = False) -> Array:
    rows = [(1.0, 0.0, COMMANDED)]
    for turn in TURNS_DEG:
        rows += [(1.0, turn, 1.0), (-1.0, turn, 1.0)]
    rows += [(1.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
    for share in GENTLE_SHARES if gentle else ():
        for turn in GENTLE_TURNS_DEG:
            rows += [(share, turn, 1.0), (-share, turn, 1.0)]
    return np.array(rows + SLOWING)


BRAKING = Certificate(
    "braking",
    "distance left after stopping straight ahead while the others hold their course (the textbook form)",
    np.array([(1.0, 0.0, 0.0)]),
    braking=True,
    pursuers=False,
)

TURNING_CIRCLE = Certificate(
    "turning_circle",
    "distance kept on the best turning circle, either side, any exit; opponents may pursue with their granted share",
    _turning_family(),
    braking=False,
    pursuers=True,
    slowing=len(SLOWING),
)

VALUE_TABLE = Certificate(
    "value_table",
    "distance that can be kept from the worst opponent, by value table; without a table as turning_circle",
    _turning_family(gentle=True),
    braking=False,
    pursuers=True,
    tables="all",
    slowing=len(SLOWING),
)

AUTO = replace(
    VALUE_TABLE,
    name="auto",
    summary="value_table for boats that are long in gaining speed, turning_circle for nimble ones",
    tables="slow",
)

CERTIFICATES = {certificate.name: certificate for certificate in (AUTO, TURNING_CIRCLE, VALUE_TABLE, BRAKING)}
