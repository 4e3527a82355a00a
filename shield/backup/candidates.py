"""The manoeuvres a boat is offered: the one in memory, the one found in this decision, and those of the family."""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from ..memory import Memory
from ..platforms import layout as L
from ..scene import Scene
from .paths import angle_to_go

IN_MEMORY, FOUND, FAMILY = range(3)
"""Numbers of the manoeuvres: that under way, that in ``plan.held``, and from `FAMILY` on those of `Boats.plans`."""

COMMANDED = -1.0
"""Speed entry of a manoeuvre that keeps the commanded speed."""

DONE_DEG = 270.0
"""A turn to go beyond this is one that has been overshot: it is done."""

FURTHEST_DEG = 200.0
"""Largest turn to go with which a manoeuvre is committed to again."""


@lean_kernel
def turn_left(heading_deg: float, target_deg: float, side: float) -> float:
    """Turn still to make of a manoeuvre to one side that ends on a heading (NaN: none), deg; past that it is done."""
    if math.isnan(target_deg):
        return 0.0
    togo = angle_to_go(heading_deg, target_deg, side)
    return 0.0 if togo > DONE_DEG else togo


@lean_kernel
def kept_turn(i: int, heading_deg: float, memory: Memory) -> float:
    """Turn still to make of the manoeuvre in memory, deg."""
    return turn_left(heading_deg, memory.target_deg[i], memory.side[i])


@lean_kernel
def remembered(i: int, done: int, heading_deg: float, memory: Memory) -> bool:
    """Whether the manoeuvre in memory can be offered.

    A boat told to turn away from it for long is offered another in good time: once committed to, a manoeuvre must not
    run over the angle at which it would be taken for done, not even by the way a boat still spins.
    """
    return memory.has_backup[i] and (done == 0 or kept_turn(i, heading_deg, memory) <= FURTHEST_DEG)


@lean_kernel
def found_turn(i: int, heading_deg: float, held: Array) -> float:
    """Turn still to make of the manoeuvre noted in ``held``, see `assign.hold`, deg."""
    return turn_left(heading_deg, held[i, 1], held[i, 0])


@lean_kernel
def candidate(i: int, p: int, wanted_mps: float, heading_deg: float, scene: Scene) -> tuple[float, float, float]:
    """Manoeuvre number p of boat i: `IN_MEMORY`, `FOUND`, or one of the family; (side, turn deg, speed m/s)."""
    boats, memory, held = scene.boats, scene.memory, scene.plan.held
    if p == IN_MEMORY:
        return memory.side[i], kept_turn(i, heading_deg, memory), memory.speed_mps[i]
    if p == FOUND:
        return held[i, 0], found_turn(i, heading_deg, held), held[i, 2]
    row = boats.plans[i, p - FAMILY]
    speed = wanted_mps if row[2] == COMMANDED else row[2] * boats.params[i, L.MAX_SPEED]
    return row[0], row[1], speed
