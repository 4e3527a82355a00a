"""Whether opponents can cut a boat off on its way to a flag and home."""

from __future__ import annotations

import numpy as np

from ..plane import distance
from ..sight import Boat, Point, Sight

STEP_M = 2.0
"""Between the points of a way that are looked at."""


def slack_m(sight: Sight, boat: Boat, grab: Point, home: Point) -> float:
    """By how much opponents that cut a boat off would miss it, m; below 0 they tag it.

    The boat sails at full speed from where it is to where it grabs the flag, and home. Opponents go by full speed for
    that point of its way on their side that they reach best: tagged ones by way of their base, those on the boat's side
    when it grabs, all others at once.
    """
    legs = [(boat.at, grab), (grab, home)]
    points = np.concatenate([np.linspace(a, b, max(int(distance(a, b) / STEP_M), 1) + 1)[1:] for a, b in legs])
    gone_m = np.cumsum(np.hypot(*np.diff(points, axis=0, prepend=[boat.at]).T))
    grabs_s = distance(*legs[0]) / boat.top
    there = points[:, 0] > sight.line
    points, times = points[there], gone_m[there] / boat.top
    slacks = [np.inf]
    for foe in sight.foes:
        at, from_s = foe.at, 0.0 if foe.on_side else grabs_s
        if foe.tagged:
            share = max(1.0 - sight.reach / max(distance(foe.at, sight.base), 1e-9), 0.0)
            at = foe.x + share * (sight.base[0] - foe.x), foe.y + share * (sight.base[1] - foe.y)
            from_s = distance(foe.at, at) / foe.top
        gap = np.hypot(*(points - at).T) - sight.reach - foe.top * np.maximum(times - from_s, 0.0)
        slacks.append(float(gap.min(initial=np.inf)))
    return min(slacks)
