"""What a game drives its boats by, tagged, out of bounds or disabled, for `Fleet.driven`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..jit import Array
from ..platforms import layout as L

FAR_M = 1e7
"""Distance of the place that a boat out of bounds is steered at: straight off the edge, to 1e-3 deg in any field."""


def time_until(x: float, y: float, place: Array, radius_m: float, fastest_mps: float) -> float:
    """Time, s, before which a boat that goes no faster cannot be within a radius of a place (or of any of several)."""
    distance_m = np.hypot(*(np.reshape(place, (-1, 2)) - (x, y)).T).min()
    return max(0.0, float(distance_m) - radius_m) / max(fastest_mps, 1e-6)


def inwards(x: float, y: float, size: Array) -> tuple[float, float, float]:
    """Far place straight off the edge nearest to a boat out of bounds, m, and how far it is beyond, m."""
    beyond = {
        (x, FAR_M): -y,
        (-FAR_M, y): x - size[0],
        (x, -FAR_M): y - size[1],
        (FAR_M, y): -x,
    }
    place = max(beyond, key=lambda one: beyond[one])
    return (*place, max(0.0, beyond[place]))


def driven_boats(core: Any) -> Array | None:
    """Rows of `Fleet.driven` for game 0 of a `BatchedMctf`; None where it drives no boat.

    Of tagged boats among obstacles nothing is said: the game leads them past those.
    """
    tagged, oob, disabled = core.is_tagged[0], core.oob[0], core.is_disabled[0]
    if not (tagged | oob | disabled).any():
        return None
    rows = np.full((core.n_boats, 4), np.nan)
    for i in np.flatnonzero(tagged | oob | disabled).tolist():
        if disabled[i]:
            rows[i] = (0.0, np.nan, np.nan, _disabled_for_s(core, i))
        elif tagged[i] and core.config.n_obstacles == 0:
            rows[i] = _driven_home(core, i)
        elif oob[i] and not tagged[i]:
            rows[i] = _driven_in(core, i)
    return rows


def _disabled_for_s(core: Any, i: int) -> float:
    """Time until the power play that stops boat ``i`` ends, s."""
    rules = core.rules
    ends = (float(core.power_start[0, core.team[i]]) + rules.power_length) * rules.decision_s
    return math.inf if ends < core.time_s[0] else float(ends - core.time_s[0])


def _driven_home(core: Any, i: int) -> tuple[float, float, float, float]:
    config, team = core.config, int(core.team[i])
    x, y, speed = core.state[0, i, [L.X, L.Y, L.SPEED]]
    corners = config.untag_at == "own_corners"
    marks = core.rules.corner_marks[team] if corners else core.flag_home[team][np.newaxis]
    ends = core.rules.corners[team] if corners else marks
    radius_m = config.corner_radius_m if corners else config.catch_radius_m
    share = config.oob_speed_frac if core.oob[0, i] else 1.0
    commanded = float(core.max_speed_mps[i]) * (
        min(share, config.tag_speed_frac) if config.tag_speed_frac < 1.0 else share
    )
    mark = marks[int(np.argmin(np.hypot(*(marks - (x, y)).T)))]
    return commanded, float(mark[0]), float(mark[1]), time_until(x, y, ends, radius_m, max(commanded, speed))


def _driven_in(core: Any, i: int) -> tuple[float, float, float, float]:
    x, y, speed = core.state[0, i, [L.X, L.Y, L.SPEED]]
    commanded = float(core.max_speed_mps[i]) * core.config.oob_speed_frac
    place_x, place_y, beyond_m = inwards(x, y, core.field.size)
    return commanded, place_x, place_y, beyond_m / max(commanded, speed, 1e-6)
