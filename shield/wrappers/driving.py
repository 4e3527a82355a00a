"""What a game drives its boats by, tagged, out of bounds or disabled, for `Fleet.driven`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..jit import Array, BoolArray
from ..platforms import layout as L

FAR_M = 1e7
"""Distance of the place that a boat out of bounds is steered at: straight off the edge, to 1e-3 deg in any field."""
SPEED, PLACE, UNTIL = 0, slice(1, 3), 3
"""Columns of `Fleet.driven`: speed m/s, place m, time s."""

LEAST_MPS = 1e-6
"""A boat is taken to move at least so fast, so that a time to anywhere is finite."""


def time_until(position: Array, places: Array, radius_m: float, fastest_mps: Any) -> Array:
    """Time, s, before which boats (..., 2) that go no faster cannot be within a radius of any of the places (k, 2)."""
    distance_m = _distances(position, places).min(axis=-1)
    return np.asarray(np.maximum(0.0, distance_m - radius_m) / np.maximum(fastest_mps, LEAST_MPS))


def nearest(position: Array, places: Array) -> Array:
    """Of the places (k, 2) the one nearest to each boat (..., 2)."""
    return np.asarray(places[_distances(position, places).argmin(axis=-1)])


def inwards(position: Array, size: Array) -> tuple[Array, Array]:
    """Far places straight off the edge nearest to boats (..., 2) out of bounds, m, and how far they are beyond, m."""
    x, y = position[..., 0], position[..., 1]
    beyond_m = np.stack([-y, x - size[0], y - size[1], -x], axis=-1)
    edge = beyond_m.argmax(axis=-1)
    place_x = np.stack([x, np.full_like(x, -FAR_M), x, np.full_like(x, FAR_M)], axis=-1)
    place_y = np.stack([np.full_like(y, FAR_M), y, np.full_like(y, -FAR_M), y], axis=-1)
    places = np.stack([_of(place_x, edge), _of(place_y, edge)], axis=-1)
    return places, np.maximum(0.0, _of(beyond_m, edge))


def driven_boats(core: Any) -> Array | None:
    """Rows of `Fleet.driven` for each of the B games of a `BatchedMctf`, (B, n, 4); None where they drive no boat.

    Of tagged boats among obstacles nothing is said: the game leads them past those.
    """
    tagged, oob, disabled = core.is_tagged, core.oob, core.is_disabled
    if not (tagged | oob | disabled).any():
        return None
    rows = np.full((*tagged.shape, 4), np.nan)
    if core.config.n_obstacles == 0:
        _drive_home(core, tagged & ~disabled, rows)
    _drive_in(core, oob & ~tagged & ~disabled, rows)
    _let_coast(core, disabled, rows)
    return rows


def _let_coast(core: Any, where: BoolArray, rows: Array) -> None:
    """Disabled boats, until the power play that stops them ends."""
    rules, game = core.rules, np.nonzero(where)[0]
    ends_s = (core.power_start[game, core.team[np.nonzero(where)[1]]] + rules.power_length) * rules.decision_s
    left_s = ends_s - core.time_s[game]
    rows[where, SPEED] = 0.0
    rows[where, UNTIL] = np.where(left_s < 0.0, np.inf, left_s)


def _drive_home(core: Any, where: BoolArray, rows: Array) -> None:
    """Tagged boats: to their own flag's home, or where there are corners to the nearer of their marks."""
    config, corners = core.config, core.config.untag_at == "own_corners"
    radius_m = config.corner_radius_m if corners else config.catch_radius_m
    share = np.where(core.oob, config.oob_speed_frac, 1.0)
    if config.tag_speed_frac < 1.0:
        share = np.minimum(share, config.tag_speed_frac)
    for team in (0, 1):
        here = where & (core.team == team)
        marks = core.rules.corner_marks[team] if corners else core.flag_home[team][np.newaxis]
        ends = core.rules.corners[team] if corners else marks
        position, speed_mps = core.state[here][:, [L.X, L.Y]], core.state[here][:, L.SPEED]
        commanded_mps = (core.max_speed_mps * share)[here]
        rows[here, SPEED] = commanded_mps
        rows[here, PLACE] = nearest(position, marks)
        rows[here, UNTIL] = time_until(position, ends, radius_m, np.maximum(commanded_mps, speed_mps))


def _drive_in(core: Any, where: BoolArray, rows: Array) -> None:
    """Boats out of bounds: straight off the nearest edge."""
    commanded_mps = (core.max_speed_mps * core.config.oob_speed_frac)[np.nonzero(where)[1]]
    places, beyond_m = inwards(core.state[where][:, [L.X, L.Y]], core.field.size)
    rows[where, SPEED] = commanded_mps
    rows[where, PLACE] = places
    rows[where, UNTIL] = beyond_m / np.maximum(np.maximum(commanded_mps, core.state[where][:, L.SPEED]), LEAST_MPS)


def _distances(position: Array, places: Array) -> Array:
    gap_m = position[..., np.newaxis, :] - places
    return np.hypot(gap_m[..., 0], gap_m[..., 1])


def _of(values: Array, which: Any) -> Array:
    """Of the last axis the entry that is asked for."""
    return np.take_along_axis(values, np.asarray(which)[..., np.newaxis], axis=-1)[..., 0]
