"""What the game makes tagged, out-of-bounds and disabled boats do, for `Fleet.driven`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..jit import Array, BoolArray
from ..platforms import layout as L

FAR_M = 1e7
"""Distance of the place that an out-of-bounds boat is steered at. So far off it is straight off the edge, to 1e-3 deg
in any field.
"""
SPEED, PLACE, UNTIL = 0, slice(1, 3), 3
"""Columns of `Fleet.driven`: speed (m/s), place (m), time (s)."""

LEAST_MPS = 1e-6
"""Least speed a boat is assumed to make, so that every travel time is finite."""


class Drives(NamedTuple):
    """How a game controls the n boats of two teams, blue first."""

    marks: Sequence[Array]  # per team, places (k, 2), m; tagged boats are steered at the nearest
    ends: Sequence[Array]  # per team, places (k, 2), m, near which tagged boats are free again
    near_m: float  # how near, m; NaN: the way of tagged boats is unknown, such as among obstacles
    size: Array  # (2,) of the field, m; out-of-bounds boats are steered straight off the nearest edge
    tagged_mps: Array  # commanded speed of tagged boats, m/s, (n,) or one for all
    oob_mps: Array  # commanded speed of out-of-bounds boats, m/s


class Driven(NamedTuple):
    """Which boats (..., n) the game controls at this moment, and how long disabled ones stay stopped, s."""

    tagged: BoolArray
    oob: BoolArray
    disabled: BoolArray
    disabled_for_s: Array


def driven_rows(drives: Drives, driven: Driven, state: Array, team: Any) -> Array | None:
    """Return rows (..., n, 4) of `Fleet.driven` for boats at a state (..., n, N_STATE); None if none is controlled."""
    tagged, oob, disabled, disabled_for_s = driven
    if not (tagged | oob | disabled).any():
        return None
    rows, position = np.full((*tagged.shape, 4), np.nan), state[..., [L.X, L.Y]]
    home_mps = np.where(oob, np.minimum(drives.tagged_mps, drives.oob_mps), drives.tagged_mps)
    back_mps = np.broadcast_to(drives.oob_mps, oob.shape)
    for number in (0, 1) if not math.isnan(drives.near_m) else ():
        here = tagged & ~disabled & (team == number)
        rows[here, SPEED], rows[here, PLACE] = home_mps[here], nearest(position[here], drives.marks[number])
        distance_m = _distances(position[here], drives.ends[number]).min(axis=-1)
        fastest_mps = np.maximum(np.maximum(home_mps[here], state[here][:, L.SPEED]), LEAST_MPS)
        rows[here, UNTIL] = np.maximum(0.0, distance_m - drives.near_m) / fastest_mps
    here = oob & ~tagged & ~disabled
    places, beyond_m = inwards(position[here], drives.size)
    rows[here, SPEED], rows[here, PLACE] = back_mps[here], places
    rows[here, UNTIL] = beyond_m / np.maximum(np.maximum(back_mps[here], state[here][:, L.SPEED]), LEAST_MPS)
    rows[disabled, SPEED], rows[disabled, UNTIL] = 0.0, disabled_for_s[disabled]
    return rows


def nearest(position: Array, places: Array) -> Array:
    """Return, of the places (k, 2), the one nearest to each boat (..., 2)."""
    return np.asarray(places[_distances(position, places).argmin(axis=-1)])


def inwards(position: Array, size: Array) -> tuple[Array, Array]:
    """Return far places straight off the nearest edge, and how far the boats (..., 2) are out of bounds; metres."""
    x, y = position[..., 0], position[..., 1]
    beyond_m = np.stack([-y, x - size[0], y - size[1], -x], axis=-1)
    edge = beyond_m.argmax(axis=-1)
    place_x = np.stack([x, np.full_like(x, -FAR_M), x, np.full_like(x, FAR_M)], axis=-1)
    place_y = np.stack([np.full_like(y, FAR_M), y, np.full_like(y, -FAR_M), y], axis=-1)
    places = np.stack([_of(place_x, edge), _of(place_y, edge)], axis=-1)
    return places, np.maximum(0.0, _of(beyond_m, edge))


def driven_boats(core: Any) -> Array | None:
    """Return rows of `Fleet.driven` for the B games of a `BatchedMctf`, (B, n, 4); None if they control no boat."""
    if not (core.is_tagged | core.oob | core.is_disabled).any():
        return None
    config, rules, corners = core.config, core.rules, core.config.untag_at == "own_corners"
    marks = rules.corner_marks if corners else core.flag_home[:, np.newaxis]
    radius_m = config.corner_radius_m if corners else config.catch_radius_m
    drives = Drives(
        marks,
        rules.corners if corners else marks,
        radius_m if config.n_obstacles == 0 else math.nan,
        core.field.size,
        core.max_speed_mps * min(config.tag_speed_frac, 1.0),
        core.max_speed_mps * config.oob_speed_frac,
    )
    ends_s = (core.power_start[:, core.team] + rules.power_length) * rules.decision_s
    left_s = ends_s - core.time_s[:, np.newaxis]
    driven = Driven(core.is_tagged, core.oob, core.is_disabled, np.where(left_s < 0.0, np.inf, left_s))
    return driven_rows(drives, driven, core.state, core.team)


def _distances(position: Array, places: Array) -> Array:
    gap_m = position[..., np.newaxis, :] - places
    return np.hypot(gap_m[..., 0], gap_m[..., 1])


def _of(values: Array, which: Any) -> Array:
    """Select one entry of the last axis."""
    return np.take_along_axis(values, np.asarray(which)[..., np.newaxis], axis=-1)[..., 0]
