"""The worst of what opponents may do against a boat: run through as pursuers, or looked up where a table answers."""

from __future__ import annotations

import math

from ..backup.paths import READY_SAMPLE
from ..jit import BoolArray, lean_kernel
from ..platforms import layout as L
from ..scene import Boats, Scene
from ..tables.lookup import WHOLE_S
from ..work import Work
from .clearance import FAR, MARGIN, Search
from .feared import feared_for
from .foreseen import may_pursue
from .pursuit import Pursuer, Pursuit, roll_out_pursuer, stays_away
from .value_function import margin_when_ready, out_of_reach, table_answers, tabled, worst_at_once

RUDDERS = (1.0, 0.6, 0.3, 0.0)
"""Hardest turns pursuers are followed with, shares of the granted one.

A hard turn costs speed, a gentle one time. Each of these turns as hard as its own entry and loses the speed of the next
gentler one, and so does better than any that turn steadily in between; the last entry is only that, none is followed.
"""

FORGOTTEN_LOSS = 0.1
"""Pursuers that lose less of their speed for good in their hardest turn are followed with that turn only."""

LEAD_SHARE = 0.15
"""Share of the time that the pursuit lasts by which a pursuer leads the boat at most."""

CHASE_LEAD_SHARE = 0.3
"""The same of one that is no faster than the boat and follows it for longer."""


@lean_kernel
def closing(i: int, j: int, scene: Scene) -> float:
    """Most the distance of a pair can shrink from sample to sample, m."""
    state, boats = scene.state, scene.boats
    top_i = max(boats.fastest_mps[i], state[i, L.SPEED])
    top_j = max(boats.fastest_mps[j], state[j, L.SPEED])
    return (top_i + top_j) * boats.sample_s


@lean_kernel
def clear_of_pursuer(i: int, j: int, slot: int, scene: Scene, floor_m: float, cap_m: float) -> float:
    """Margin, m, of boat i on the path in ``slot`` from opponent j using the turn and thrust granted to it against it.

    The worst of several pursuers: steering at the boat or for the meeting point, turning hard or gently. The one that
    came below its floor last is looked at first. They are followed until the boat's thrust is full and as long beyond
    as such a boat needs to get away; where a table is for the pair it tells what they can do from where thrust is full,
    of an outnumbered boat (see `value_function.find_outnumbered`) not before ``boats.joint_samples``.
    """
    boats, work = scene.boats, scene.work
    ready = int(work.ready[slot, READY_SAMPLE])
    till_ready = ready >= 0 and tabled(i, j, boats, work)
    closely = boats.pursuit_samples[i] + boats.thrust_samples[i]
    if ready >= 0:
        closely = min(closely, ready + boats.pursuit_samples[i])
    lasts = closely + (0 if till_ready else boats.chase_samples[i, j])
    if not till_ready and _never_near(i, j, slot, lasts, scene, cap_m):
        return cap_m
    pursuit = pursuit_of(i, j, slot, lasts, closely, till_ready, scene)
    worst_m = FAR
    manners = 2 * (len(RUDDERS) - 1) if boats.granted_loss[j] > FORGOTTEN_LOSS else 2
    first = min(work.first_manner[i, j], manners - 1)
    for number in range(manners):
        manner = first_then_rest(first, number)
        margin_m, weight = _run_pursuer(i, j, slot, manner, pursuit, scene, floor_m, cap_m)
        if till_ready and margin_m >= floor_m:
            margin_m = min(margin_m, _value_at_end(i, j, slot, weight, boats, work))
        if margin_m < worst_m:
            worst_m = margin_m
            if worst_m < floor_m:
                work.first_manner[i, j] = manner
                break
    return worst_m


@lean_kernel
def _never_near(i: int, j: int, slot: int, lasts: int, scene: Scene, cap_m: float) -> bool:
    """Whether no run of opponent j, however it steers, ends with less than the cap: then none needs to be made.

    No decision changes by it; without it those of herons in games, mostly far from everybody, take a third longer.
    """
    state, boats, work = scene.state, scene.boats, scene.work
    way = max(boats.params[j, L.MAX_SPEED], state[j, L.SPEED]) * boats.sample_s
    closing_m, radius_m = closing(i, j, scene), work.radius[i, j]
    return stays_away(work.path[slot], work.course[j, 0], work.course[j, 1], way, lasts, closing_m, radius_m, cap_m)


@lean_kernel
def pursuit_of(i: int, j: int, slot: int, lasts: int, closely: int, till_ready: bool, scene: Scene) -> Pursuit:
    """A pursuit of boat i by opponent j that lasts so many samples, or until thrust on the path in ``slot`` is full.

    How far the pursuer leads the boat goes by how long it lasts, and negative margins fade as much by the end of any.
    For ``closely`` see `Pursuit`.
    """
    boats, work = scene.boats, scene.work
    samples = min(lasts, int(work.ready[slot, READY_SAMPLE])) if till_ready else lasts
    fear_s = feared_for(i, j, scene.state[i, L.SPEED], boats, work)
    adverse = samples if fear_s >= WHOLE_S else min(samples, math.ceil(fear_s / boats.sample_s))
    ahead = (CHASE_LEAD_SHARE if lasts > closely else LEAD_SHARE) * lasts
    fade = boats.fade[i] ** (boats.pursuit_samples[i] / lasts)
    return Pursuit(boats.sample_s, samples, adverse, closely, ahead, fade, till_ready)


@lean_kernel
def _run_pursuer(
    i: int, j: int, slot: int, manner: int, pursuit: Pursuit, scene: Scene, floor_m: float, cap_m: float
) -> tuple[float, float]:
    """Margin, m, from opponent j pursuing in one manner, and what negative margins have faded by."""
    state, boats, work = scene.state, scene.boats, scene.work
    course = work.course[j]
    turn = math.radians(boats.granted_turn_dps[j]) * boats.sample_s  # also from rest: thrust, and turn, comes soon
    pursuer = Pursuer(
        course[0],
        course[1],
        course[2],
        course[3],
        state[j, L.SPEED],
        boats.params[j, L.MAX_SPEED],
        boats.granted_acc_mps2[j],
        boats.granted_dec_mps2[j],
        boats.granted_loss[j] * RUDDERS[manner // 2 + 1],
        RUDDERS[manner // 2] * turn,
        manner % 2 == 1,
    )
    search = Search(closing(i, j, scene), work.radius[i, j], floor_m, cap_m)
    return roll_out_pursuer(work.path[slot], pursuer, pursuit, search, work.pursuer)


@lean_kernel
def _value_at_end(i: int, j: int, slot: int, weight: float, boats: Boats, work: Work) -> float:
    """Margin, m, that the table tells of where thrust is full and the pursuer's run ends; faded where negative."""
    margin = margin_when_ready(i, j, slot, boats, work)
    return margin * weight if margin < 0.0 else margin


@lean_kernel
def first_then_rest(first: int, number: int) -> int:
    """Entry ``number`` of the list 0, 1, 2, ... with ``first`` moved to its front."""
    if number == 0:
        return first
    return number if number > first else number - 1


@lean_kernel
def pursues(i: int, j: int, ours: BoolArray, boats: Boats, work: Work) -> bool:
    """Whether boat j is an opponent of boat i that is granted more than holding its course."""
    return not ours[j] and boats.team[i] != boats.team[j] and may_pursue(j, boats, work)


@lean_kernel
def _forget_threats(slot: int, work: Work) -> None:
    """Make ready for the threats to the path in ``slot``."""
    work.threats_m[slot, :] = FAR
    work.joint_m[slot], work.table_m[slot], work.threat_m[slot] = FAR, FAR, FAR
    work.threat_by[slot], work.sealed[slot] = -1, False


@lean_kernel
def _note_threat(margin_m: float, j: int, slot: int, work: Work) -> None:
    """Note a margin from boat j if it is the least."""
    if margin_m < work.threat_m[slot]:
        work.threat_m[slot], work.threat_by[slot] = margin_m, j


@lean_kernel
def _clear_by_table(i: int, j: int, slot: int, boats: Boats, work: Work) -> float:
    """Margin, m, from opponent j where a table is looked up first."""
    margin_m = worst_at_once(i, j, slot, boats, work)
    work.table_m[slot] = min(work.table_m[slot], margin_m)
    if margin_m < work.threat_target_m[i, j]:
        work.sealed[slot] = True
    return margin_m


@lean_kernel
def _clear_by_run(i: int, j: int, slot: int, floor_m: float, scene: Scene) -> float:
    """Margin, m, of an outnumbered boat from opponent j, run through for a while and looked up from there.

    At most the cap; on a manoeuvre on which thrust never is full the boat is lost.
    """
    tuning, work = scene.tuning, scene.work
    if work.ready[slot, READY_SAMPLE] < 0.0:
        margin_m = -work.radius[i, j]
    elif out_of_reach(i, j, slot, closing(i, j, scene), scene):
        margin_m = tuning.margin_cap_m
    else:
        margin_m = clear_of_pursuer(i, j, slot, scene, floor_m, tuning.margin_cap_m)
    work.joint_m[slot] = min(work.joint_m[slot], margin_m)
    return margin_m


@lean_kernel
def _clear_of_threat(i: int, j: int, slot: int, level_m: float, scene: Scene) -> bool:
    """Note what is feared of opponent j; False when it is short of its target and below the level."""
    boats, tuning, work = scene.boats, scene.tuning, scene.work
    floor_m, by_table = min(work.threat_target_m[i, j], level_m), table_answers(i, j, slot, boats, work)
    if by_table:
        margin_m = _clear_by_table(i, j, slot, boats, work)
    else:
        # one cap for all: a pursuer's steps depend on it, and must not depend on who is looked at before
        margin_m = clear_of_pursuer(i, j, slot, scene, floor_m, tuning.margin_cap_m)
    work.threats_m[slot, j] = margin_m
    _note_threat(margin_m, j, slot, work)
    if not margin_m >= floor_m or not by_table or not work.outnumbered[i]:
        return margin_m >= floor_m
    floor_m = min(work.joint_target_m[i], level_m)
    margin_m = _clear_by_run(i, j, slot, floor_m, scene)
    _note_threat(margin_m, j, slot, work)
    return margin_m >= floor_m


@lean_kernel
def _falls_short(i: int, slot: int, scene: Scene) -> bool:
    """Whether a margin against pursuers on the path in ``slot`` is short of what boat i must keep."""
    work = scene.work
    short = work.outnumbered[i] and not work.joint_m[slot] >= work.joint_target_m[i]
    for j in range(scene.ours.shape[0]):
        short = short or not work.threats_m[slot, j] >= work.threat_target_m[i, j]
    return short


@lean_kernel
def worst_pursuer(i: int, slot: int, scene: Scene, level_m: float) -> None:
    """Clearance from each pursuer, in ``work.threats_m[slot]``; that in ``slot`` is lowered where it is worse.

    What is known in full of a path is not asked again: it hangs on no team-mate's manoeuvre, nor on the targets.

    Of one that is short of its target (``work.fails``) and below the level nothing more is to be known: the search
    stops. Who came there last is looked at first, so that of many manoeuvres those that fail cost little.

    ``work.sealed[slot]`` says whether the boat is short of a target by what a table tells of where it is looked up
    first, and by nothing worse. One step on (done = 1) that is one place for all manoeuvres: then none does better.
    """
    state, ours, boats, work = scene.state, scene.ours, scene.boats, scene.work
    if not work.pursuers_known[slot]:
        work.pursuers_known[slot] = True
        _forget_threats(slot, work)
        first = work.first_pursuer[i]
        for number in range(state.shape[0]):
            j = first_then_rest(first, number)
            if j == i or not work.near[i, j] or work.breach[i, j] or not pursues(i, j, ours, boats, work):
                continue
            if not _clear_of_threat(i, j, slot, level_m, scene):
                work.first_pursuer[i] = j
                work.pursuers_known[slot] = False
                break
        work.sealed[slot] = work.sealed[slot] and work.threat_m[slot] >= work.table_m[slot]
    work.fails[slot] = _falls_short(i, slot, scene)
    if work.threat_m[slot] < work.clear[slot, MARGIN]:
        work.clear[slot, MARGIN], work.bound[slot] = work.threat_m[slot], work.threat_by[slot]
