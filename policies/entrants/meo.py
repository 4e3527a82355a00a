"""Meo-Indep: man-to-man defence.

The paper: the intercept points of every pair of defender and attacker are computed, pairs are chosen for the least
total distance, each boat drives to its point at full speed and stops there; where paths of teammates cross, one
heading is turned to the opposite. Filled in: an intercept point is where the defender at full speed meets the attacker
going on as it does, moved into the own half; of two boats whose paths cross the later one is turned.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment

from .catalogue import entrant
from .plane import STOP_MPS, Order, clip, cross, distance, heading_to, meeting_point
from .play import EntrantTeam
from .sight import Point, Sight

ARRIVED_M = 3.0
MARGIN_M = 2.0
"""Points are kept this far off the dividing line and the edges."""


@entrant("meo", "man-to-man defence: intercept points, pairs of least total distance (Meo-Indep)", "Meo-Indep")
class Meo(EntrantTeam):
    """Each boat marks one attacker."""

    name = "meo"

    def decide(self, sight: Sight) -> list[Order]:
        """Full speed to the intercept points, one of two crossing boats turned round."""
        points = marked(sight)
        headings = [heading_to(boat.at, point) for boat, point in zip(sight.own, points, strict=True)]
        for later in crossing(sight, points):
            headings[later] += math.pi
        return [
            (STOP_MPS if distance(boat.at, point) <= ARRIVED_M else boat.top, heading)
            for boat, point, heading in zip(sight.own, points, headings, strict=True)
        ]


def marked(sight: Sight) -> list[Point]:
    """Where each own boat meets the attacker it marks; its own place where there are fewer attackers."""
    points = [[_in_half(sight, meeting_point(boat, foe)) for foe in sight.foes] for boat in sight.own]
    costs = np.array([[distance(boat.at, p) for p in row] for boat, row in zip(sight.own, points, strict=True)])
    found = [boat.at for boat in sight.own]
    for boat, foe in zip(*linear_sum_assignment(costs), strict=True):
        found[int(boat)] = points[int(boat)][int(foe)]
    return found


def crossing(sight: Sight, points: list[Point]) -> set[int]:
    """The later boat of each two whose paths cross."""
    ways = [(boat.at, point) for boat, point in zip(sight.own, points, strict=True)]
    return {j for i, j in combinations(range(len(ways)), 2) if cross(*ways[i], *ways[j])}


def _in_half(sight: Sight, point: Point) -> Point:
    return clip(point[0], MARGIN_M, sight.line - MARGIN_M), clip(point[1], MARGIN_M, sight.size[1] - MARGIN_M)
