"""The manoeuvres a boat is offered: the one in memory, and those of the family."""

from __future__ import annotations

import math

from ..jit import lean_kernel
from ..memory import Memory
from ..platforms import layout as L
from ..scene import Scene, Tuning
from .paths import angle_to_go
from .rank import STATIC_LOST

COMMANDED = -1.0
"""Speed entry of a manoeuvre that keeps the commanded speed."""

DONE_DEG = 270.0
"""A turn to go beyond this is one that has been overshot: it is done."""

FURTHEST_DEG = 200.0
"""Largest turn to go with which a manoeuvre is committed to again."""


@lean_kernel
def kept_turn(i: int, heading_deg: float, memory: Memory) -> float:
    """Turn still to make of the manoeuvre in memory, deg; past its target it is done."""
    if math.isnan(memory.target_deg[i]):
        return 0.0
    togo = angle_to_go(heading_deg, memory.target_deg[i], memory.side[i])
    return 0.0 if togo > DONE_DEG else togo


@lean_kernel
def remembered(i: int, done: int, heading_deg: float, memory: Memory) -> bool:
    """Whether the manoeuvre in memory can be offered.

    A boat told to turn away from it for long is offered another in good time: once committed to, a manoeuvre must not
    run over the angle at which it would be taken for done, not even by the way a boat still spins.
    """
    return memory.kept[i] and (done == 0 or kept_turn(i, heading_deg, memory) <= FURTHEST_DEG)


@lean_kernel
def candidate(i: int, p: int, wanted_mps: float, heading_deg: float, scene: Scene) -> tuple[float, float, float]:
    """Manoeuvre number p of boat i: 0 is the one in memory, the rest the family; (side, turn deg, speed m/s)."""
    boats, memory = scene.boats, scene.memory
    if p == 0:
        return memory.side[i], kept_turn(i, heading_deg, memory), memory.speed_mps[i]
    row = boats.plans[i, p - 1]
    speed = wanted_mps if row[2] == COMMANDED else row[2] * boats.params[i, L.MAX_SPEED]
    return row[0], row[1], speed


@lean_kernel
def hysteresis(rank: float, tuning: Tuning) -> float:
    """Rank by which another manoeuvre must beat the one under way, in the units of its level."""
    return tuning.hysteresis_m if rank < STATIC_LOST else 1e-3 * tuning.hysteresis_m


@lean_kernel
def preference(i: int, p: int, side: float, togo_deg: float, rank: float, scene: Scene) -> float:
    """What manoeuvre number p of a boat on its backup gains or loses in rank by the hysteresis."""
    boats, tuning, memory = scene.boats, scene.tuning, scene.memory
    if not memory.backing_up[i]:
        return 0.0
    if boats.table_steps[i] == 0:
        return hysteresis(rank, tuning) if p == 0 else 0.0
    turning = togo_deg > 0.0 and not math.isnan(memory.target_deg[i])
    return -hysteresis(rank, tuning) if turning and side * memory.side[i] < 0.0 else 0.0
