"""Start places of experiments: random, at rest, far enough apart that no hit is decided at the start.

Most policies are deterministic, so games differ by their start places alone; the preset's own random starts
give boats speeds and places from which a violation cannot be avoided, which would say nothing about a shield.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.field import field_geometry
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

GAP_M = 8.0
"""Boats start at least this far apart, from each other and from flags."""
SPREAD_DEG = 45.0
"""Boats head for the opponents' flag, this much to either side."""
TRIES = 2000


def opening(config: GameConfig, seed: int) -> dict[str, Any]:
    """Draw start places and headings, the same of the same seed.

    Every boat lies at rest on its own side, `GAP_M` or more from every other boat, flag home and field edge
    (less where the field is small), heading for the opponents' flag give or take `SPREAD_DEG`.

    Returns:
        ``init_dict`` for ``env.reset(options={"init_dict": ...})``.

    Raises:
        ConfigError: obstacles or the number of boats leave no room.
    """
    field, rng = field_geometry(config), np.random.default_rng([seed, 0x5EA])
    homes, gap_m = field.flag_home, min(GAP_M, float(field.size.min()) / (2.0 * config.team_size))
    places, headings = list[Array](), list[float]()
    for boat in range(config.n_boats):
        team = boat // config.team_size
        for _ in range(TRIES):
            place = rng.uniform(gap_m, field.size - gap_m)
            own, other = np.linalg.norm(homes - place, axis=1)[[team, 1 - team]]
            # a boat's width clear of the dividing line, so that it starts on its own side
            clear = min(np.linalg.norm(place - thing) for thing in (*places, *homes)) >= gap_m and other - own > gap_m
            if clear and not _on_obstacle(config, place, gap_m):
                break
        else:
            raise ConfigError("no start places found; use fewer boats or obstacles, a larger field, or --fixed-start")
        east, north = homes[1 - team] - place
        places.append(np.asarray(place))
        headings.append(float(np.degrees(np.arctan2(east, north)) + rng.uniform(-SPREAD_DEG, SPREAD_DEG)))
    return {
        "agent_position": [place.tolist() for place in places],
        "agent_heading": [(heading + 180.0) % 360.0 - 180.0 for heading in headings],
        "agent_speed": [0.0] * config.n_boats,
    }


def _on_obstacle(config: GameConfig, place: Array, gap_m: float) -> bool:
    obstacles = config.obstacles or {"circle": (), "polygon": ()}
    if any(np.linalg.norm(place - centre) < radius + gap_m for radius, centre in obstacles["circle"]):
        return True
    boxes = (np.array(corners) for corners in obstacles["polygon"])  # a polygon's bounding box will do
    return any(bool(((place > b.min(axis=0) - gap_m) & (place < b.max(axis=0) + gap_m)).all()) for b in boxes)
