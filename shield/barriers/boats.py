"""Distance kept from boats whose way is known: team-mates on their backups, opponents that hold their course.

For boat i with backup manoeuvre m (turn to one side, then straight, at a set speed),

    h_i(x) = max over m of min over neighbours j, over what j may do, over t of |p_i(t; m) - p_j(t)| - R_ij,

with the boat's own motion from its full model (thrust lag, speed lost in the turn, turn rate bound by thrust). The
manoeuvre is one for all neighbours of a boat, so rows of different neighbours never contradict each other: the
manoeuvre itself satisfies them all (backup certificates: Chen, Jankovic, Santillo, Ames 2021). What opponents may do
beyond holding their course is in `opponents`.
"""

from __future__ import annotations

import math

from ..jit import Array, BoolArray, copy_row, lean_kernel
from ..platforms import layout as L
from ..scene import Scene
from ..work import Work
from .clearance import FAR, MARGIN, Course, Search, clear_of_course
from .opponents import closing

ROUNDING_M = 1e-6
"""Margins are looked at so far beyond what must be kept: one that is said to be above must not round to below."""

RECOVERY_S = 1.5
"""When already inside the radius, manoeuvres are ranked by the distance they reach after this time, s."""


@lean_kernel
def _rank_recovery(i: int, j: int, path: Array, scene: Scene) -> None:
    """In breach no margin is left to compare: rank by not closing further and by the distance soon after."""
    state, ours, boats, work = scene.state, scene.ours, scene.boats, scene.work
    sample_s = boats.sample_s
    k = min(boats.samples[i], max(1, int(RECOVERY_S / sample_s)))
    if ours[j] or work.known[j]:
        x, y = work.path[j, k, 0], work.path[j, k, 1]
    else:
        way = state[j, L.SPEED] * k * sample_s
        x, y = work.course[j, 0] + way * work.course[j, 2], work.course[j, 1] + way * work.course[j, 3]
    later = math.hypot(path[k, 0] - x, path[k, 1] - y)
    now = math.hypot(state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y])
    least = work.out[MARGIN] + work.radius[i, j]
    work.out[MARGIN] = -1e-3 + min(0.0, later - work.radius[i, j]) + 2.0 * min(0.0, least - now)


@lean_kernel
def reported_margin(i: int, state: Array, work: Work) -> float:
    """Certificate of boat i as it is told, m; of a boat in breach how far it is inside the radius now (negative).

    In breach the clearance of a manoeuvre is a rank, see `_rank_recovery`, and no distance.
    """
    least, in_breach = FAR, False
    for j in range(state.shape[0]):
        if j != i and work.near[i, j] and work.breach[i, j]:
            in_breach = True
            gap = math.hypot(state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y])
            least = min(least, gap - work.radius[i, j])
    return least if in_breach else work.clear[i, MARGIN]


@lean_kernel
def clear_of_boat(i: int, j: int, path: Array, scene: Scene, floor_m: float, cap_m: float) -> None:
    """Clearance row of boat i on ``path`` from boat j, into ``work.out``.

    One that is not ours to steer, and whose way is not foreseen, holds course and speed.
    """
    state, ours, boats, tuning, work = scene.state, scene.ours, scene.boats, scene.tuning, scene.work
    floor, cap = floor_m, cap_m
    if work.breach[i, j]:
        floor, cap = -FAR, FAR
    search = Search(closing(i, j, scene), work.radius[i, j], floor, cap)
    tail = tuning.tail_s / boats.sample_s
    if ours[j] or work.known[j]:
        samples = min(boats.samples[i], boats.samples[j])
        clear_of_course(path, Course(work.path[j], 0.0, 0.0, 0.0, 0.0), samples, tail, search, work.out)
    else:
        now, way = work.course[j], state[j, L.SPEED] * boats.sample_s
        course = Course(work.path[0, :0], now[0], now[1], way * now[2], way * now[3])
        clear_of_course(path, course, boats.samples[i], tail, search, work.out)
    if work.breach[i, j]:
        _rank_recovery(i, j, path, scene)


@lean_kernel
def must_keep(i: int, j: int, ours: BoolArray, work: Work) -> float:
    """Margin boat i must keep from boat j, whatever else is feared of it, m."""
    return work.mate_target_m[i] if ours[j] else work.target[i]


@lean_kernel
def worst_clearance(i: int, slot: int, scene: Scene, floor_m: float) -> None:
    """Worst clearance of boat i on the path in ``slot`` from team-mates' paths and opponents' straight courses.

    ``work.short[slot]`` says whether one of them is below what must be kept; then the one that is so by most binds,
    of margins below 0 the least.
    """
    state, ours, tuning, work = scene.state, scene.ours, scene.tuning, scene.work
    clear = work.clear[slot]
    clear[MARGIN] = FAR
    work.bound[slot] = -1
    work.short[slot] = False
    shortest_m = 0.0
    for j in range(state.shape[0]):
        if j == i or not work.near[i, j]:
            continue
        least_m = must_keep(i, j, ours, work)
        enough_m = max(least_m + ROUNDING_M, min(clear[MARGIN], tuning.margin_cap_m))
        clear_of_boat(i, j, work.path[slot], scene, floor_m, enough_m)
        lacks_m = work.out[MARGIN] - least_m
        if lacks_m < shortest_m:
            work.short[slot], shortest_m = True, lacks_m
            if clear[MARGIN] >= 0.0:
                work.bound[slot] = j
        if work.out[MARGIN] < clear[MARGIN]:
            copy_row(clear, work.out)
            if not work.short[slot] or clear[MARGIN] < 0.0:
                work.bound[slot] = j
            if clear[MARGIN] < floor_m:
                return
