"""Opponent models by name: a family of backup manoeuvres, with opponents rolled out or looked up in value tables.

A model's h is as in `barriers.boats`. Each row of a family is (rudder, turn deg, speed). The rudder is a share of
full rudder, clockwise when > 0. Speed is a fraction of top speed, or `COMMANDED`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..jit import Array, lean_kernel
from ..platforms import Platform
from ..platforms import layout as L
from ..platforms.limits import Limits, limits_of
from ..workspace import BACKUP_HEADING, BACKUP_RUDDER, BACKUP_SPEED, HAS_BACKUP, Scene
from .paths import angle_to_go

IN_MEMORY, FOUND, FAMILY = range(3)
"""Manoeuvre numbers: the remembered one, that in ``scene.held``, and from `FAMILY` on those of `Boats.manoeuvres`."""

COMMANDED = -1.0
"""Speed entry of a manoeuvre at the commanded speed."""

DONE_DEG = 270.0
"""A turn left beyond this has been overshot: it counts as done."""

FURTHEST_DEG = 200.0
"""Largest turn left with which a manoeuvre is committed to again."""

TURNS_DEG = tuple(15.0 * k for k in range(1, 13))
"""Full-rudder turns of boats whose opponents are rolled out. With finer steps a small enough turn is found sooner."""

LOOKED_UP_TURNS_DEG = (15.0, 30.0, 45.0, 60.0, 90.0, 120.0, 180.0)
"""The same of boats with a value table, which gives the value of play after the next step, wherever a turn ends."""

GENTLE_SHARES = (0.5, 0.25)
"""Rudder shares of further half turns of boats with a value table: a hard turn costs speed, and with it room."""

SLOWING_TURNS_DEG = (45.0, 90.0, 180.0)
SLOWING_SPEEDS = (0.5, 0.0)
"""Turns below full speed, which boats that steer without thrust try as well, see `OpponentModel.slowing`."""

SLOW_TO_REGAIN_S = 5.0
"""Under "auto", boats that take longer than this to regain top speed look opponents up in value tables, s.

What a boat can do against pursuers after it has lost its speed depends on play too long to be rolled out well. For
nimble boats rollouts are better: one manoeuvre against all pursuers at once.
"""

REACTION_S = 4.0
"""Time beyond a half turn over which a turning backup is followed, s."""

LONGEST_PURSUIT_S = 60.0
"""Longest time over which a pursuing opponent is followed, s."""


@dataclass(frozen=True)
class OpponentModel:
    """Families of backup manoeuvres, rows of (rudder, turn deg, speed), with their horizon.

    Attributes:
        name: its name in settings.
        summary: meaning of h, one line.
        rolled_out: (m, 3) manoeuvres of boats whose opponents are rolled out.
        looked_up: (m, 3) manoeuvres of boats whose opponents are looked up in value tables.
        slowing: (m, 3) further manoeuvres of boats that steer without thrust; other boats lose their rudder with it.
        tables: which boats look opponents up in value tables: "none", "slow" ones, or "all".
    """

    name: str
    summary: str
    rolled_out: Array
    looked_up: Array
    slowing: Array
    tables: str = "none"

    def horizon_s(self, platform: Platform, dt_s: float) -> float:
        """Return the time over which the manoeuvres are followed, s."""
        return limits_of(platform, dt_s).half_turn_s + REACTION_S

    def manoeuvres(self, platform: Platform, with_table: bool) -> Array:
        """Return the (m, 3) manoeuvres of a boat, in the order in which they are tried."""
        rolled_out = self.looked_up if with_table else self.rolled_out
        return np.vstack([rolled_out, self.slowing]) if platform.kind == "rate" else rolled_out

    def uses_table(self, limits: Limits) -> bool:
        """Return whether a boat looks opponents up where there is a table."""
        slow = limits.top_speed_mps > SLOW_TO_REGAIN_S * limits.acceleration_mps2
        return self.tables == "all" or (self.tables == "slow" and slow)

    def pursuit_s(self, limits: Limits) -> float:
        """Return how long pursuers are followed, s: a boat outruns them only once it has regained its speed."""
        return min(LONGEST_PURSUIT_S, limits.half_turn_s + REACTION_S + limits.regain_s)


def _turning(turns_deg: Sequence[float], gentle_shares: Sequence[float] = ()) -> Array:
    rows = [(1.0, 0.0, COMMANDED)]
    for turn in turns_deg:
        rows += [(1.0, turn, 1.0), (-1.0, turn, 1.0)]
    rows += [(1.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
    for share in gentle_shares:
        rows += [(share, 180.0, 1.0), (-share, 180.0, 1.0)]
    return np.array(rows)


def _slowing() -> Array:
    rows = [(1.0, 0.0, 0.5)]
    rows += [(rudder, turn, v) for v in SLOWING_SPEEDS for turn in SLOWING_TURNS_DEG for rudder in (1.0, -1.0)]
    return np.array(rows)


TURNING_CIRCLE = OpponentModel(
    "turning_circle",
    "distance kept on the best turning circle, either side, any exit; opponents may pursue with their granted share",
    rolled_out=_turning(TURNS_DEG),
    looked_up=_turning(LOOKED_UP_TURNS_DEG, GENTLE_SHARES),
    slowing=_slowing(),
)

VALUE_TABLE = replace(
    TURNING_CIRCLE,
    name="value_table",
    summary="distance that can be kept from the worst opponent, by value table; without a table as turning_circle",
    tables="all",
)

AUTO = replace(
    VALUE_TABLE,
    name="auto",
    summary="value_table for boats that are long in gaining speed, turning_circle for nimble ones",
    tables="slow",
)

OPPONENT_MODELS = {model.name: model for model in (AUTO, TURNING_CIRCLE, VALUE_TABLE)}


@lean_kernel
def turn_left(heading_deg: float, target_deg: float, rudder: float) -> float:
    """Return the turn left, deg, of a manoeuvre that ends on a heading (NaN: no turn); 0 once past it."""
    if math.isnan(target_deg):
        return 0.0
    togo = angle_to_go(heading_deg, target_deg, rudder)
    return 0.0 if togo > DONE_DEG else togo


@lean_kernel
def kept_turn(i: int, heading_deg: float, scene: Scene) -> float:
    """Return the turn left of the remembered manoeuvre, deg."""
    memory = scene.memory
    return turn_left(heading_deg, memory[i, BACKUP_HEADING], memory[i, BACKUP_RUDDER])


@lean_kernel
def remembered(i: int, ahead: int, heading_deg: float, scene: Scene) -> bool:
    """Return whether the remembered manoeuvre can be offered.

    A boat whose commands turn it away from its manoeuvre for long is offered another in good time. A manoeuvre that is
    committed to must not pass the angle at which it counts as done, not even by the turn that a boat still makes.
    """
    memory = scene.memory
    return memory[i, HAS_BACKUP] > 0.0 and (ahead == 0 or kept_turn(i, heading_deg, scene) <= FURTHEST_DEG)


@lean_kernel
def found_turn(i: int, heading_deg: float, held: Array) -> float:
    """Return the turn left of the manoeuvre in ``held``, see `assign.hold`, deg."""
    return turn_left(heading_deg, held[i, 1], held[i, 0])


@lean_kernel
def candidate(i: int, p: int, commanded_mps: float, heading_deg: float, scene: Scene) -> tuple[float, float, float]:
    """Return manoeuvre p of boat i, `IN_MEMORY`, `FOUND` or one of the family: (rudder, turn deg, speed m/s)."""
    boats, memory, held = scene.boats, scene.memory, scene.held
    if p == IN_MEMORY:
        return memory[i, BACKUP_RUDDER], kept_turn(i, heading_deg, scene), memory[i, BACKUP_SPEED]
    if p == FOUND:
        return held[i, 0], found_turn(i, heading_deg, held), held[i, 2]
    row = boats.manoeuvres[i, p - FAMILY]
    speed = commanded_mps if row[2] == COMMANDED else row[2] * boats.params[i, L.MAX_SPEED]
    return row[0], row[1], speed
