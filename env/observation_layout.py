"""Order, names and bounds of the numbers in an observation.

Bearings are relative to the boat's heading, deg, clockwise, in (-180, 180]; distances m; speeds m/s; booleans 0 or 1.
"""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array, IntArray

from .config import GameConfig
from .field import FieldGeometry

OWN_STATUS = 15
"""Where the boat's own has_flag, on_side, tagging_cooldown, is_tagged and, where it is told, is_disabled begin."""
OTHER_STATUS = 4
"""Where those of another boat begin, after the start of its numbers."""

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


def sizes(shows_disabled: bool) -> tuple[int, int]:
    """How many numbers there are about the boat itself and the field, scores last, and about each other boat."""
    return (22, 9) if shows_disabled else (21, 8)


def observation_keys(config: GameConfig) -> tuple[Key, ...]:
    """Names of an observation's numbers, in order."""
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
    """Where boat i's observation holds boat j, (n, n): teammates in order without itself, then opponents.

    A boat's own slot is such that its status lies at the same offset as another boat's.
    """
    n, size = config.n_boats, config.team_size
    own_numbers, other_numbers = sizes(config.shows_disabled)
    slots = np.full((n, n), OWN_STATUS - OTHER_STATUS, dtype=np.int64)
    for i in range(n):
        mates = [j for j in range(n) if j // size == i // size and j != i]
        others = [j for j in range(n) if j // size != i // size]
        for k, j in enumerate(mates + others):
            slots[i, j] = own_numbers + other_numbers * k
    return slots


def observation_bounds(config: GameConfig, field: FieldGeometry, max_speed_mps: float) -> tuple[Array, Array]:
    """Lower and upper bounds of the raw observation, each (n_obs,)."""
    ranges = {
        "bearing": (-180.0, 180.0),
        "relative_heading": (-180.0, 180.0),
        "distance": (0.0, field.diagonal),
        "speed": (0.0, max_speed_mps),
        "tagging_cooldown": (0.0, config.tagging_cooldown_s),
        "score": (0.0, float(config.max_score)),
    }
    low, high = [], []
    for key in observation_keys(config):
        name = key if isinstance(key, str) else key[1]
        kind = next((end for end in ranges if name.endswith(end)), None)
        bounds = (0.0, 1.0) if kind is None else ranges[kind]
        low.append(bounds[0])
        high.append(bounds[1])
    return np.array(low), np.array(high)
