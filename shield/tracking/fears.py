"""For how long each boat is feared as an opponent: what is said of it, else the settings."""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, BoolArray, lean_kernel
from ..scene import Scene


@lean_kernel
def note_fears(visiting: BoolArray, said_s: Array, scene: Scene) -> None:
    """Note how long each boat may do its worst: what is said, (n,) s, or where that is NaN the settings."""
    tuning, work = scene.tuning, scene.work
    for i in range(said_s.shape[0]):
        time_s = tuning.visitor_s if visiting[i] else tuning.feared_s
        if not math.isnan(said_s[i]):
            time_s = said_s[i]
        work.fear_s[i] = time_s if tuning.feared_s > 0.0 else 0.0


@lean_kernel
def one_of_one_team(scene: Scene) -> int:
    """A boat that is decided for, where all such are of one team; -1: they are of several, or there is none."""
    ours, team, found = scene.ours, scene.boats.team, -1
    for i in range(ours.shape[0]):
        if ours[i]:
            if found >= 0 and team[i] != team[found]:
                return -1
            found = i
    return found


@lean_kernel
def told_fear(i: int, mate: int, scene: Scene) -> float:
    """How long boat i is feared, s, as it is told: 0 where its way is foreseen, NaN of who is nobody's opponent.

    ``mate`` is as of `one_of_one_team`.
    """
    team = scene.boats.team
    if scene.ours[i] or (mate >= 0 and team[i] == team[mate]):
        return np.nan
    return 0.0 if scene.work.known[i] else scene.work.fear_s[i]
