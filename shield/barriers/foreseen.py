"""Where boats go that nobody decides for: the game drives them, tagged to a place, or lets them coast, disabled.

They are followed as what they are, by the boat and autopilot model under the game's own commands, instead of as
pursuers or as boats that hold their course.
"""

from __future__ import annotations

import math

import numpy as np

from ..fleet import LARGEST, LARGEST_SPEED_MPS
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..platforms.usv import wrap_degrees
from ..scene import Boats, Scene
from ..work import Work

DRIVEN_MPS, DRIVEN_X, DRIVEN_Y, DRIVEN_S = range(4)
"""What drives a boat: speed m/s (NaN: not driven), place it is steered at, m (NaN: none, the heading error is 0), and
the time, s, for which that is sure to last."""


@lean_kernel
def error_to(row: Array, x: float, y: float) -> float:
    """Heading error, deg, of a boat (its state row) that is to steer at (x, y), m; 0 where there is no such place."""
    if math.isnan(x):
        return 0.0
    bearing = np.float64(math.degrees(math.atan2(x - row[L.X], y - row[L.Y])))
    return wrap_degrees(bearing - row[L.HEADING])


@lean_kernel
def note_foreseen(driven: Array, scene: Scene) -> None:
    """Note which boats' ways are foreseen by what drives them, (n, 4), see `Fleet.driven`.

    That takes a speed that a boat can have, and a whole place or none: half a place would be foreseen as no number at
    all, from which everything keeps clear. And it must last as long as the longest backup manoeuvre.
    """
    ours, boats, work = scene.ours, scene.boats, scene.work
    last = 0
    for i in range(ours.shape[0]):
        copy_row(work.driven[i], driven[i])
        last = max(last, boats.samples[i])
    for i in range(ours.shape[0]):
        x_m, y_m = driven[i, DRIVEN_X], driven[i, DRIVEN_Y]
        place = (math.isnan(x_m) and math.isnan(y_m)) or (abs(x_m) <= LARGEST and abs(y_m) <= LARGEST)
        lasts = driven[i, DRIVEN_S] >= last * boats.sample_s
        work.known[i] = not ours[i] and place and lasts and 0.0 <= driven[i, DRIVEN_MPS] <= LARGEST_SPEED_MPS


@lean_kernel
def may_pursue(j: int, boats: Boats, work: Work) -> bool:
    """Whether boat j as an opponent is granted more than holding its course, or the way that is foreseen."""
    return boats.granted_turn_dps[j] > 0.0 and not work.known[j]


@lean_kernel
def foresee(scene: Scene) -> None:
    """Write the ways of boats of ``work.known`` into ``work.path``: sample 0 is one step of the model from now.

    They are written as far as anybody looks at them: as long as the longest of backup manoeuvres.
    """
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    last = 0
    for i in range(state.shape[0]):
        last = max(last, boats.samples[i])
    for j in range(state.shape[0]):
        if not work.known[j]:
            continue
        drive, path, row = work.driven[j], work.path[j], work.row
        copy_row(row, state[j])
        for k in range(last + 1):
            for _ in range(1 if k == 0 else boats.stride):
                error = error_to(row, drive[DRIVEN_X], drive[DRIVEN_Y])
                step_boat(boats.params[j], row, drive[DRIVEN_MPS], error, tuning.model_s)
            path[k, 0], path[k, 1] = row[L.X], row[L.Y]
