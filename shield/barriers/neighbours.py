"""Which pairs of boats can matter to a decision, and the radius each pair must keep."""

from __future__ import annotations

import math

import numpy as np

from ..fleet import LARGEST, LARGEST_SPEED_MPS
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..platforms.usv import next_thrust, wrap_degrees
from ..workspace import DRIVEN, PATH_COST, PURSUER_COST, Scene
from .value_function import find_several_pursuers, run_opponents

REGAIN_M = 0.01
"""A pair inside the buffer must part by at least this in the next step, m."""


@lean_kernel
def find_neighbours(scene: Scene) -> None:
    """Find the course of every boat, and for each pair whether it can matter and at what radius.

    A pair is left out when its distance exceeds R_ij + (fastest i + fastest j) * (longer horizon + straight run). No
    boat exceeds its fastest speed, so the pair stays apart by more than R_ij on every path of the backup check. Its
    margin is then positive for every manoeuvre and command, its row can never be active, and leaving it out changes no
    decision.

    The radius is the separation with error margins and buffer. A pair inside the buffer must part again. A pair inside
    the separation itself violates it.
    """
    scene.spent[0], scene.cut_short[0] = 0.0, False
    scene.cost[:] = PATH_COST
    run_opponents(1, scene)
    for i in range(scene.state.shape[0]):
        _note_course(i, scene)
        for j in range(i):
            _note_pair(i, j, scene)
    predict_game_controlled(scene)
    find_several_pursuers(scene)


@lean_kernel
def _note_course(i: int, scene: Scene) -> None:
    """Note where boat i is one step ahead if it holds its course, before its neighbours are looked at."""
    row, course = scene.state[i], scene.course[i]
    scene.pursued[i], scene.first_pursuer[i] = False, 0
    scene.first_rudder[i, :] = 0
    scene.reach_samples[i] = _reach_samples(i, scene)
    heading, way = math.radians(row[L.HEADING]), row[L.SPEED] * scene.tuning.model_s
    ux, uy = math.sin(heading), math.cos(heading)
    course[0], course[1], course[2], course[3] = row[L.X] + way * ux, row[L.Y] + way * uy, ux, uy


@lean_kernel
def _note_pair(i: int, j: int, scene: Scene) -> None:
    """Note whether two boats can matter to each other, at what radius, and what checking them costs."""
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    top = max(boats.fastest_mps[i], state[i, L.SPEED]) + max(boats.fastest_mps[j], state[j, L.SPEED])
    opponents = boats.team[i] != boats.team[j]
    samples = max(boats.samples[i], boats.samples[j])
    if opponents:
        reach_i = scene.reach_samples[i] + boats.chase_samples[i, j]
        samples = max(samples, max(reach_i, scene.reach_samples[j] + boats.chase_samples[j, i]))
    radius = tuning.radius_m + scene.error_m[i] + scene.error_m[j]
    dx, dy = state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y]
    square = dx * dx + dy * dy
    reach = radius + top * ((samples + 1) * boats.sample_s + tuning.straight_horizon_s)
    near = square <= reach * reach
    scene.neighbours[i, j], scene.neighbours[j, i] = near, near
    if not near:
        return
    cost = 1.0 + (PURSUER_COST if opponents else 0.0)
    scene.cost[i], scene.cost[j] = scene.cost[i] + cost, scene.cost[j] + cost
    if opponents:
        scene.pursued[i] = scene.pursued[i] or may_pursue(j, scene)
        scene.pursued[j] = scene.pursued[j] or may_pursue(i, scene)
    least, now = radius - tuning.buffer_m, math.sqrt(square)
    scene.inside_separation[i, j], scene.inside_separation[j, i] = now < least, now < least
    kept = max(least, min(radius, now + REGAIN_M))
    scene.radius[i, j], scene.radius[j, i] = kept, kept


@lean_kernel
def _reach_samples(i: int, scene: Scene) -> int:
    """Return the number of samples over which opponents of boat i may be followed.

    A boat whose thrust suffices for the next step, whatever is commanded, counts as one at full thrust. So does a boat
    that is not own: nobody looks at its manoeuvres.
    """
    state, ours, boats, tuning = scene.state, scene.ours, scene.boats, scene.tuning
    if not ours[i]:
        return boats.pursuit_samples[i]
    row = state[i]
    least, _, _ = next_thrust(
        boats.params[i], row[L.SPEED], row[L.THRUST], row[L.SPEED_ERROR], row[L.SPEED_INTEGRAL], 0.0, tuning.model_s
    )
    if boats.table_steps[i] == 0 and min(least, row[L.THRUST]) >= boats.full_thrust_percent[i]:
        return boats.pursuit_samples[i]
    return boats.pursuit_samples[i] + boats.thrust_samples[i]


DRIVEN_MPS, DRIVEN_X, DRIVEN_Y, DRIVEN_S = range(4)
"""Columns of `Fleet.driven`: speed m/s (NaN: not driven), place that the boat is steered at, m (NaN: none, the heading
error is 0), and the time, s, for which that is sure to last."""


@lean_kernel
def error_to(row: Array, x: float, y: float) -> float:
    """Heading error, deg, of a boat (its state row) that is to steer at (x, y), m; 0 where there is no such place."""
    if math.isnan(x):
        return 0.0
    bearing = np.float64(math.degrees(math.atan2(x - row[L.X], y - row[L.Y])))
    return wrap_degrees(bearing - row[L.HEADING])


@lean_kernel
def note_predicted(given: Array, scene: Scene) -> None:
    """Note which boats are predicted by what drives them, see `Fleet.driven`.

    This needs a speed that a boat can have, and a whole position or none: half a position would predict NaN, from
    which everything stays clear. It must also last as long as the longest backup manoeuvre.
    """
    ours, boats = scene.ours, scene.boats
    last = 0
    for i in range(ours.shape[0]):
        copy_row(scene.driven[i], given[i, DRIVEN:])
        last = max(last, boats.samples[i])
    for i in range(ours.shape[0]):
        driven = scene.driven[i]
        x_m, y_m = driven[DRIVEN_X], driven[DRIVEN_Y]
        place = (math.isnan(x_m) and math.isnan(y_m)) or (abs(x_m) <= LARGEST and abs(y_m) <= LARGEST)
        lasts = driven[DRIVEN_S] >= last * boats.sample_s
        scene.predicted[i] = not ours[i] and place and lasts and 0.0 <= driven[DRIVEN_MPS] <= LARGEST_SPEED_MPS


@lean_kernel
def may_pursue(j: int, scene: Scene) -> bool:
    """Return whether opponent j may do more than hold its course or follow its predicted way."""
    boats = scene.boats
    return boats.granted_turn_dps[j] > 0.0 and not scene.predicted[j]


@lean_kernel
def _near_ours(j: int, scene: Scene) -> bool:
    """Return whether boat j can matter to an own boat."""
    near = False
    for i in range(scene.ours.shape[0]):
        near = near or (scene.ours[i] and scene.neighbours[i, j])
    return near


@lean_kernel
def predict_game_controlled(scene: Scene) -> None:
    """Predict boats of ``scene.predicted`` into ``scene.path``; sample 0 is one step of the model ahead.

    Only boats near own ones are predicted, as long as the longest backup manoeuvre.
    """
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    last = 0
    for i in range(state.shape[0]):
        last = max(last, boats.samples[i])
    for j in range(state.shape[0]):
        if not scene.predicted[j] or not _near_ours(j, scene):
            continue
        drive, path, row = scene.driven[j], scene.path[j], scene.row
        copy_row(row, state[j])
        for k in range(last + 1):
            for _ in range(1 if k == 0 else boats.stride):
                error = error_to(row, drive[DRIVEN_X], drive[DRIVEN_Y])
                step_boat(boats.params[j], row, drive[DRIVEN_MPS], error, tuning.model_s)
            path[k, 0], path[k, 1] = row[L.X], row[L.Y]
