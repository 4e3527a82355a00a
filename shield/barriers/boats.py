"""The barrier against boats whose way is known: teammates on their backups, opponents that hold their course.

For boat i with backup manoeuvre m (turn to one side, then straight, at a set speed),

    h_i(x) = max over m of min over neighbours j, over what j may do, over t of |p_i(t; m) - p_j(t)| - R_ij,

with the boat's own motion from its full model (thrust lag, speed lost in the turn, turn rate bound by thrust). One
manoeuvre serves all neighbours of a boat, so rows of different neighbours never contradict each other: the manoeuvre
satisfies them all (backup certificates: Chen, Jankovic, Santillo, Ames 2021). What opponents may do beyond holding
their course is in `pursuit`.
"""

from __future__ import annotations

import math

from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..workspace import Scene
from .clearance import FAR, MARGIN, clear_of_course
from .pursuit import closing

ROUNDING_M = 1e-6
"""Margins are computed this far beyond the required one: a margin reported above it must not round to below."""


@lean_kernel
def reported_margin(i: int, scene: Scene) -> float:
    """Return the safety margin of boat i as reported, m: infinite where nobody can meet it.

    Inside the separation it is minus the boat's depth there now.
    """
    state = scene.state
    least, in_violation = FAR, False
    for j in range(state.shape[0]):
        if j != i and scene.neighbours[i, j] and scene.inside_separation[i, j]:
            in_violation = True
            gap = math.hypot(state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y])
            least = min(least, gap - scene.radius[i, j])
    if in_violation:
        return least
    return scene.clear[i, MARGIN] if scene.clear[i, MARGIN] < FAR else math.inf


@lean_kernel
def clear_of_boat(i: int, j: int, path: Array, scene: Scene, floor_m: float, cap_m: float) -> None:
    """Find the clearance row of boat i on ``path`` from boat j, in ``scene.out``.

    A boat that is not own, and whose way is not predicted, holds course and speed. Two that both have a path are
    compared for the longer of their horizons: the slower boat of a mixed team still turns when the nimble one is done.
    """
    state, ours, boats, tuning = scene.state, scene.ours, scene.boats, scene.tuning
    search = closing(i, j, scene), scene.radius[i, j], floor_m, cap_m
    tail, samples = tuning.straight_horizon_s / boats.sample_s, boats.samples[i]
    course, way = scene.course[j], state[j, L.SPEED] * boats.sample_s
    if ours[j] or scene.predicted[j]:
        samples = max(samples, boats.samples[j])
        clear_of_course(path, scene.path[j], course, way, samples, tail, search, scene.out)
    else:
        clear_of_course(path, scene.path[0, :0], course, way, samples, tail, search, scene.out)


@lean_kernel
def required_margin_m(i: int, j: int, scene: Scene) -> float:
    """Return the margin that boat i must keep from boat j if j's way is known, m."""
    ours = scene.ours
    return scene.teammate_target_m[i] if ours[j] else scene.target[i]


@lean_kernel
def worst_clearance(i: int, slot: int, scene: Scene, floor_m: float) -> None:
    """Find the worst clearance of boat i on the path in ``slot`` from teammates' paths and opponents' straight courses.

    ``scene.violates_predicted[slot]`` says whether one of them is below its required margin. Then the constraint that
    is violated by most is active; of margins below 0 the least.
    """
    state, tuning = scene.state, scene.tuning
    clear = scene.clear[slot]
    clear[MARGIN] = FAR
    scene.active[slot] = -1
    scene.violates_predicted[slot] = False
    shortest_m = 0.0
    for j in range(state.shape[0]):
        if j == i or not scene.neighbours[i, j]:
            continue
        least_m = required_margin_m(i, j, scene)
        enough_m = max(least_m + ROUNDING_M, min(clear[MARGIN], tuning.margin_cap_m))
        clear_of_boat(i, j, scene.path[slot], scene, floor_m, enough_m)
        lacks_m = scene.out[MARGIN] - least_m
        if lacks_m < shortest_m:
            scene.violates_predicted[slot], shortest_m = True, lacks_m
            if clear[MARGIN] >= 0.0:
                scene.active[slot] = j
        if scene.out[MARGIN] < clear[MARGIN]:
            copy_row(clear, scene.out)
            if not scene.violates_predicted[slot] or clear[MARGIN] < 0.0:
                scene.active[slot] = j
            if clear[MARGIN] < floor_m:
                return
