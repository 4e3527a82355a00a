"""Stations before the own base, and which boat takes which."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from .plane import ahead, distance
from .sight import Point, Sight

GAP_M = 9.0
"""Between neighbouring stations: more than the largest collision radius of the presets."""


def arc(sight: Sight) -> list[Point]:
    """A station per own boat, on the circle of the grab radius round the own flag, facing the dividing line."""
    radius = max(sight.reach, sight.keepout + max(boat.radius for boat in sight.own) + 1.0)
    step = 2.0 * math.asin(min(GAP_M / (2.0 * radius), 1.0))
    first = 0.5 * math.pi - 0.5 * step * (len(sight.own) - 1)
    return [ahead(sight.home, first + k * step, radius) for k in range(len(sight.own))]


def row(sight: Sight) -> list[Point]:
    """A station per own boat in a row across the own half, midway to the dividing line: the presets' start places."""
    x, gap = 0.5 * (sight.home[0] + sight.line), sight.size[1] / (len(sight.own) + 1)
    return [(x, gap * (k + 1)) for k in range(len(sight.own))]


def assign(starts: Sequence[Point], ends: Sequence[Point]) -> list[int]:
    """For each start the number of its end, the sum of all distances being least; -1 where ends are fewer."""
    costs = np.array([[distance(a, b) for b in ends] for a in starts])
    chosen = [-1] * len(starts)
    for start, end in zip(*linear_sum_assignment(costs), strict=True):
        chosen[int(start)] = int(end)
    return chosen
