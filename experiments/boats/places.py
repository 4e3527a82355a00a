"""Where simulated boats start."""

from __future__ import annotations

from collections.abc import Sequence

from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import layout as L

from .settings import SimBoat


def start_places(boats: Sequence[SimBoat], preset: str) -> list[tuple[float, float, float]]:
    """Start of each boat, x m, y m, heading deg: its own, else the game's fixed places for teams of that size.

    Raises:
        ConfigError: the preset is unknown.
    """
    largest = max(1, *(sum(boat.team == team for boat in boats) for team in (0, 1)))
    core = BatchedMctf(GameConfig.preset(preset, team_size=largest, default_start=True))
    taken = {0: 0, 1: largest}
    places = []
    for boat in boats:
        row = core.state[0, taken[min(boat.team, 1)]]
        taken[min(boat.team, 1)] += 1
        there = (float(row[L.X]), float(row[L.Y]), float(row[L.HEADING]))
        places.append(boat.start or there)
    return places
