"""How close boats are, and will come when all hold course and speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from steerclear.shield.fleet import Fleet
from steerclear.shield.jit import Array

LOOK_AHEAD_S = 60.0
"""Approaches later than this are not looked for."""


@dataclass(frozen=True)
class Approach:
    """Two boats and their closest approach.

    Attributes:
        boat, other: names.
        distance_m: now, m.
        closest_m: least distance within `LOOK_AHEAD_S`, m.
        in_s: time until then, s; 0 when they draw apart.
    """

    boat: str
    other: str
    distance_m: float
    closest_m: float
    in_s: float


def approaches(fleet: Fleet) -> dict[str, Approach]:
    """The closest approach of each controlled boat to any other, by its name; none without another boat."""
    velocity = fleet.speed_mps[:, None] * np.stack([np.sin(fleet.heading_rad), np.cos(fleet.heading_rad)], axis=1)
    found = {}
    for i in np.flatnonzero(fleet.controlled):
        pairs = [_approach(fleet, velocity, int(i), j) for j in range(len(fleet)) if j != i]
        if pairs:
            found[fleet.names[i]] = min(pairs, key=lambda pair: (pair.closest_m, pair.distance_m))
    return found


def _approach(fleet: Fleet, velocity: Array, i: int, j: int) -> Approach:
    apart = fleet.position_m[j] - fleet.position_m[i]
    closing = velocity[j] - velocity[i]
    square = float(closing @ closing)
    in_s = 0.0 if square < 1e-9 else min(LOOK_AHEAD_S, max(0.0, -float(apart @ closing) / square))
    closest = apart + in_s * closing
    distance_m = math.hypot(*apart.tolist())
    return Approach(fleet.names[i], fleet.names[j], distance_m, math.hypot(*closest.tolist()), in_s)
