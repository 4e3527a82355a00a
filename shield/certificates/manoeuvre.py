"""The manoeuvre certificate: a boat is safe while some escape manoeuvre keeps clear of everybody.

For boat i with escape manoeuvre m (turn to one side, then straight, at a set speed),

    h_i(x) = max over m of min over neighbours j, over what j may do, over t of |p_i(t; m) - p_j(t)| - R_ij,

with the boat's own motion from its full model (thrust lag, speed lost in the turn, turn rate bound by thrust). The
manoeuvre is one for all neighbours of a boat, so rows of different neighbours never contradict each other: the
manoeuvre itself satisfies them all (backup certificates: Chen, Jankovic, Santillo, Ames 2021). Team-mates are taken
along their own manoeuvres; opponents straight on and, when a turn is granted to them, as pursuers.
"""

from __future__ import annotations

import math

from ..jit import Array, BoolArray, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.usv import next_thrust
from ..scene import Scene
from ..work import Work
from .clearance import FAR, MARGIN, Course, Search, clear_of_course
from .effort import HUNTER_COST, begin_counting
from .foreseen import foresee
from .hunters import closing
from .values import find_beset, run_opponents

REGAIN_M = 0.01
"""A pair inside the buffer must part by at least this in the next step, m."""

ROUNDING_M = 1e-6
"""Margins are looked at so far beyond what must be kept: one that is said to be above must not round to below."""

RECOVERY_S = 1.5
"""When already inside the radius, manoeuvres are ranked by the distance they reach after this time, s."""


@lean_kernel
def could_meet(i: int, j: int, scene: Scene) -> bool:
    """Whether any two manoeuvres could bring team-mates i and j near each other, see `look_around`."""
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    top = max(boats.fastest_mps[i], state[i, L.SPEED]) + max(boats.fastest_mps[j], state[j, L.SPEED])
    horizon_s = (max(boats.samples[i], boats.samples[j]) + 1) * boats.sample_s + tuning.tail_s
    dx, dy = state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y]
    reach = tuning.radius_m + top * horizon_s
    return dx * dx + dy * dy <= reach * reach


@lean_kernel
def look_around(scene: Scene, margin_m: Array) -> None:
    """Courses of all boats, and for each pair whether it can matter and which radius holds.

    A pair is left out when its distance exceeds R_ij + (fastest i + fastest j) * (longer horizon + tail). No boat ever
    exceeds its fastest speed, so on every path the certificate looks at the pair stays apart by more than R_ij: its
    margin is positive for every manoeuvre and every command, its row can never be the binding one, and leaving it
    out changes no decision.

    The radius is the separation with error margins and buffer. A pair already inside the buffer must come apart
    again; one inside the separation itself is in breach, see `_rank_recovery`.
    """
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    n = state.shape[0]
    begin_counting(work)
    run_opponents(1, scene)
    foresee(scene)
    for i in range(n):
        work.hunted[i] = False
        work.reach_samples[i] = _reach_samples(i, scene)
        work.first_hunter[i] = work.first_refuser[i] = 0
        work.first_manner[i, :] = 0
        heading = math.radians(state[i, L.HEADING])
        ux, uy = math.sin(heading), math.cos(heading)
        way = state[i, L.SPEED] * tuning.model_s
        work.course[i, 0], work.course[i, 1] = state[i, L.X] + way * ux, state[i, L.Y] + way * uy
        work.course[i, 2], work.course[i, 3] = ux, uy
        top_i = max(boats.fastest_mps[i], state[i, L.SPEED])
        for j in range(i):
            top = top_i + max(boats.fastest_mps[j], state[j, L.SPEED])
            samples = max(boats.samples[i], boats.samples[j])
            if boats.team[i] != boats.team[j]:
                reach_i = work.reach_samples[i] + boats.chase_samples[i, j]
                samples = max(samples, max(reach_i, work.reach_samples[j] + boats.chase_samples[j, i]))
            horizon_s = (samples + 1) * boats.sample_s + tuning.tail_s
            radius = tuning.radius_m + margin_m[i] + margin_m[j]
            dx, dy = state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y]
            square = dx * dx + dy * dy
            reach = radius + top * horizon_s
            hit = square <= reach * reach
            work.near[i, j], work.near[j, i] = hit, hit
            if hit:
                work.cost[i] += 1.0
                work.cost[j] += 1.0
                if boats.team[i] != boats.team[j]:
                    work.hunted[i] = work.hunted[i] or boats.granted_turn_dps[j] > 0.0
                    work.hunted[j] = work.hunted[j] or boats.granted_turn_dps[i] > 0.0
                    work.cost[i] += HUNTER_COST
                    work.cost[j] += HUNTER_COST
                least = radius - tuning.buffer_m
                now = math.sqrt(square)
                work.breach[i, j] = now < least
                work.breach[j, i] = now < least
                held = max(least, min(radius, now + REGAIN_M))
                work.radius[i, j], work.radius[j, i] = held, held
    find_beset(scene)


@lean_kernel
def _reach_samples(i: int, scene: Scene) -> int:
    """Samples over which opponents of boat i may be followed.

    One whose thrust stays enough for the next step, whatever is commanded, is followed as boats are that have all of
    theirs; so is one that is not ours, whose manoeuvres nobody looks at.
    """
    state, ours, boats, tuning = scene.state, scene.ours, scene.boats, scene.tuning
    if not ours[i]:
        return boats.hunt_samples[i]
    row = state[i]
    least, _, _ = next_thrust(
        boats.params[i], row[L.SPEED], row[L.THRUST], row[L.SPEED_ERROR], row[L.SPEED_INTEGRAL], 0.0, tuning.model_s
    )
    if boats.look[i] == 0 and min(least, row[L.THRUST]) >= boats.ready_thrust[i]:
        return boats.hunt_samples[i]
    return boats.hunt_samples[i] + boats.thrust_samples[i]


@lean_kernel
def clear_of_opponent(i: int, j: int, path: Array, scene: Scene, floor_m: float, cap_m: float) -> None:
    """Clearance of boat i on ``path`` from boat j that is not ours to steer and holds course and speed."""
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    now, way = work.course[j], state[j, L.SPEED] * boats.sample_s
    course = Course(work.path[0, :0], now[0], now[1], way * now[2], way * now[3])
    search = Search(closing(i, j, scene), work.radius[i, j], floor_m, cap_m)
    clear_of_course(path, course, boats.samples[i], tuning.tail_s / boats.sample_s, search, work.out)


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
def told_margin(i: int, state: Array, work: Work) -> float:
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
    """Clearance row of boat i on ``path`` from boat j, into ``work.out``."""
    ours, boats, tuning, work = scene.ours, scene.boats, scene.tuning, scene.work
    floor, cap = floor_m, cap_m
    if work.breach[i, j]:
        floor, cap = -FAR, FAR
    if ours[j] or work.known[j]:
        samples = min(boats.samples[i], boats.samples[j])
        course = Course(work.path[j], 0.0, 0.0, 0.0, 0.0)
        search = Search(closing(i, j, scene), work.radius[i, j], floor, cap)
        clear_of_course(path, course, samples, tuning.tail_s / boats.sample_s, search, work.out)
    else:
        clear_of_opponent(i, j, path, scene, floor, cap)
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
