"""Order, names and bounds of the numbers in an observation.

Bearings are relative to the boat's heading, deg, clockwise, in (-180, 180]; distances m; speeds m/s; booleans 0 or 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from steerclear.shield.jit import Array, IntArray, lean_kernel

from .angles import heading_to, wrap_bearing
from .config import GameConfig
from .field import FieldGeometry

OWN_STATUS = 15
"""Index of the boat's own has_flag; on_side, tagging_cooldown, is_tagged and (where shown) is_disabled follow."""
OTHER_STATUS = 4
"""Index of those entries of another boat, relative to the start of its numbers."""

Key = str | tuple[str, str]

OTHER_ENTRIES = (
    "bearing",
    "distance",
    "relative_heading",
    "speed",
    "has_flag",
    "on_side",
    "tagging_cooldown",
    "is_tagged",
)


def name_of(key: Key) -> str:
    """Return the quantity of an entry, without the boat that it belongs to."""
    return key if isinstance(key, str) else key[1]


def observation_keys(config: GameConfig) -> tuple[Key, ...]:
    """Return the names of an observation's numbers, in order."""
    keys: list[Key] = []
    for place in ("opponent_home", "own_home", "wall_0", "wall_1", "wall_2", "wall_3", "scrimmage_line"):
        keys += [f"{place}_bearing", f"{place}_distance"]
    disabled = ["is_disabled"] if config.shows_disabled else []
    keys += ["speed", "has_flag", "on_side", "tagging_cooldown", "is_tagged", *disabled, "team_score", "opponent_score"]
    others = [f"teammate_{k}" for k in range(config.team_size - 1)]
    others += [f"opponent_{k}" for k in range(config.team_size)]
    keys += [(other, entry) for other in others for entry in (*OTHER_ENTRIES, *disabled)]
    for k in range(config.n_obstacles):
        keys += [f"obstacle_{k}_distance", f"obstacle_{k}_bearing"]
    return tuple(keys)


def boat_slots(config: GameConfig) -> IntArray:
    """Return the index (n, n) in boat i's observation where the numbers of boat j start.

    Teammates come first, then opponents. The index of boat i itself is such that its status is written to the right
    place.
    """
    n, size = config.n_boats, config.team_size
    own_numbers, other_numbers = (22, 9) if config.shows_disabled else (21, 8)  # scores last
    slots = np.full((n, n), OWN_STATUS - OTHER_STATUS, dtype=np.int64)
    for i in range(n):
        mates = [j for j in range(n) if j // size == i // size and j != i]
        others = [j for j in range(n) if j // size != i // size]
        for k, j in enumerate(mates + others):
            slots[i, j] = own_numbers + other_numbers * k
    return slots


def bounds_of(
    keys: Sequence[Key], config: GameConfig, field: FieldGeometry, max_speed_mps: float
) -> tuple[Array, Array]:
    """Return lower and upper bounds of raw entries, each (n,); positions have two numbers."""
    beyond = 5.0 * float(np.max(config.agent_radius_m))
    place = ([-beyond, -beyond], [*(field.size + beyond)])
    ranges: dict[str, Any] = {
        "bearing": (-180.0, 180.0),
        "heading": (-180.0, 180.0),
        "distance": (0.0, field.diagonal),
        "speed": (0.0, max_speed_mps),
        "tagging_cooldown": (0.0, config.tagging_cooldown_s),
        "score": (0.0, float(config.max_score)),
        "pos": place,
        "flag_home": place,
    }
    ends = [next((end for end in ranges if name_of(key).endswith(end)), "") for key in keys]
    low, high = zip(*(ranges.get(end, (0.0, 1.0)) for end in ends), strict=True)
    return np.hstack(low), np.hstack(high)


START_X, START_Y, ALONG_X, ALONG_Y, LENGTH, TO_LEFT, TO_RIGHT = range(7)
"""Columns of a packed line: start, unit vector along it, length, headings perpendicular to it."""


def pack_lines(segments: Array) -> Array:
    """Prepare segments (k, 2, 2), m, for `sight_of_line`: (k, 7)."""
    rows = np.zeros((len(segments), 7))
    for row, (start, end) in zip(rows, segments, strict=True):
        length = float(np.linalg.norm(end - start))
        ux, uy = (end - start) / length
        row[:] = (*start, ux, uy, length, heading_to(-uy, ux), heading_to(uy, -ux))
    return rows


@lean_kernel
def sight_of_point(x: float, y: float, heading: float, point_x: float, point_y: float) -> tuple[float, float]:
    """Return bearing and distance of a point, seen from (x, y) under ``heading``."""
    dx, dy = point_x - x, point_y - y
    return wrap_bearing(heading_to(dx, dy) - heading), math.sqrt(dx * dx + dy * dy)


@lean_kernel
def sight_of_line(x: float, y: float, heading: float, lines: Array, k: int) -> tuple[float, float]:
    """Return bearing and distance of the closest point of packed line ``k``.

    Abreast of the line the direction is perpendicular to it and known in advance: exact and without an arc tangent.
    """
    dx, dy = x - lines[k, START_X], y - lines[k, START_Y]
    along = dx * lines[k, ALONG_X] + dy * lines[k, ALONG_Y]
    to_right = dx * lines[k, ALONG_Y] - dy * lines[k, ALONG_X]
    if 0.0 < along < lines[k, LENGTH] and to_right != 0.0:
        towards = lines[k, TO_LEFT] if to_right > 0.0 else lines[k, TO_RIGHT]
        return wrap_bearing(towards - heading), abs(to_right)
    along = max(0.0, min(along, lines[k, LENGTH]))
    foot_x = lines[k, START_X] + along * lines[k, ALONG_X]
    foot_y = lines[k, START_Y] + along * lines[k, ALONG_Y]
    return sight_of_point(x, y, heading, foot_x, foot_y)
