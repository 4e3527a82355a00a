"""Where a boat takes the flag, and which macro-actions are worth a try at once."""

from __future__ import annotations

import math

import numpy as np
from steerclear.env.core import BatchedMctf
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import layout as L

from ...rollout import HEADINGS, STOP
from ..sight import docks_of


def home_of(core: BatchedMctf, team: int, boat: int, game: int = 0) -> Array:
    """Where a boat takes the flag, m: the nearest dock from where it is now, else the base."""
    docks = np.array(docks_of(core, team)).reshape(-1, 2)
    if not len(docks):
        return np.asarray(core.flag_home[team])
    place = core.state[game, boat, [L.X, L.Y]]
    return np.asarray(docks[int(np.linalg.norm(docks - place, axis=1).argmin())])


def hints_for(core: BatchedMctf, boat: int, home: Array, game: int = 0) -> IntArray:
    """Macro-actions of a boat straight to the other flag and home, and a stop."""
    place, goal = core.state[game, boat, :2], core.flag_position[game, 1 - int(core.team[boat])]
    headings = [math.degrees(math.atan2(aim[0] - place[0], aim[1] - place[1])) for aim in (goal, home)]
    return np.array([*(round(heading / 45.0) % HEADINGS for heading in headings), STOP], dtype=np.int64)
