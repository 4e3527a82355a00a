"""Which backup manoeuvre each own boat holds: found one boat at a time, with the others' fixed, until all fit."""

from __future__ import annotations

import math

import numpy as np

from .. import workspace as W
from ..jit import Array, BoolArray, copy_row, lean_kernel
from ..platforms import layout as L
from ..workspace import Scene, all_spent
from .family import FAMILY, FOUND, IN_MEMORY, candidate, found_turn, remembered
from .rollout import lay_placed, place_manoeuvre, roll_out
from .score import (
    CLEAR_OF_ALL,
    CLEAR_OF_BOATS,
    CLEAR_OF_OBSTACLES,
    WORST,
    Score,
    all_satisfy,
    better,
    is_no_better,
    score_path,
)

SWEEPS = 2


@lean_kernel
def _take(i: int, slot: int, score: Score, scene: Scene) -> None:
    """Make the trial in ``slot`` boat i's manoeuvre."""
    for k in range(scene.path.shape[1]):
        copy_row(scene.path[i, k], scene.path[slot, k])
    copy_row(scene.manoeuvre[i], scene.manoeuvre[slot])
    copy_row(scene.table_place[i], scene.table_place[slot])
    copy_row(scene.full_thrust[i], scene.full_thrust[slot])
    copy_row(scene.clear[i], scene.clear[slot])
    copy_row(scene.static_clear[i], scene.static_clear[slot])
    scene.static_known[i], scene.static_by[i] = scene.static_known[slot], scene.static_by[slot]
    scene.pursuit_margin_m[i] = scene.pursuit_margin_m[slot]
    scene.violates_pursuers[i] = scene.violates_pursuers[slot]
    copy_row(scene.pursuit_margins_m[i], scene.pursuit_margins_m[slot])
    scene.joint_m[i] = scene.joint_m[slot]
    scene.pursuer[i] = scene.pursuer[slot]
    scene.pursuers_known[i] = scene.pursuers_known[slot]
    scene.refused_by_table[i] = scene.refused_by_table[slot]
    scene.active[i] = scene.active[slot]
    scene.satisfied[i], scene.score_m[i] = score


@lean_kernel
def choose_manoeuvre(i: int, commanded_mps: float, ahead: int, best_of: bool, scene: Scene) -> None:
    """Give boat i a manoeuvre: the first that is safe, or with ``best_of`` the best.

    Equal scores go to the first in the family: starboard before port, as the rules of the road ask. If the manoeuvre
    found by the nominal check, or the remembered one, is safe from the present state, no others are tried. One
    exception: by tables, manoeuvres differ only from the present state, so all are tried where the nominal command
    violates the margin from an opponent. One step ahead, a table refuses all manoeuvres or none; then the first that
    clears all else is taken.

    Once the decision has used its work budget, the best so far is taken, see `workspace.all_spent`.
    """
    state, boats = scene.state, scene.boats
    trial = state.shape[0]
    heading = scene.next_state[i, L.HEADING] if ahead == 1 else state[i, L.HEADING]
    best = WORST
    violated = scene.violated[i]
    compared = boats.table_steps[i] > 0 and ahead == 0 and violated >= 0 and not scene.ours[violated]
    for p in range(boats.n_manoeuvres[i] + FAMILY):
        if p == IN_MEMORY and not remembered(i, ahead, heading, scene):
            continue
        if p == FOUND and (ahead == 1 or compared):
            continue
        if best.satisfied == CLEAR_OF_ALL and (not best_of or (p == FAMILY and not compared)):
            return
        place_manoeuvre(i, trial, candidate(i, p, commanded_mps, heading, scene), ahead, scene)
        if ahead == 0 and is_no_better(i, trial, best, scene):
            scene.spent[0] += scene.cost[i]
        else:
            lay_placed(i, trial, ahead, scene)
            score = score_path(i, trial, best, scene)
            if better(score, best):
                best = score
                _take(i, trial, score, scene)
        if (ahead == 1 and scene.refused_by_table[trial]) or all_spent(scene):
            return


@lean_kernel
def refresh(i: int, scene: Scene) -> None:
    """Score boat i's manoeuvre again against the others' present ones."""
    scene.satisfied[i], scene.score_m[i] = score_path(i, i, WORST, scene)


@lean_kernel
def needs_no_search(i: int, sweep: int, ahead: int, scene: Scene) -> bool:
    """Return whether the search for boat i is over in this sweep, see `assign_manoeuvres`."""
    memory = scene.memory
    was_short = (
        memory[i, W.HAS_BACKUP] > 0.0
        and memory[i, W.BACKING_UP] > 0.0
        and (memory[i, W.BACKUP_MARGIN] < 0.0 or scene.satisfied[i] >= CLEAR_OF_BOATS)
    )
    if scene.satisfied[i] == CLEAR_OF_ALL or (sweep > 0 and scene.satisfied[i] >= CLEAR_OF_OBSTACLES):
        return True
    return ahead == 1 and was_short


@lean_kernel
def note_manoeuvre(i: int, held: Array, scene: Scene) -> None:
    """Note boat i's manoeuvre as seen from its predicted state: rudder, end heading (NaN: no turn), speed."""
    rudder, togo = scene.manoeuvre[i, 0], scene.manoeuvre[i, 1]
    held[i, 0], held[i, 2] = rudder, scene.manoeuvre[i, 2]
    held[i, 1] = scene.next_state[i, L.HEADING] + math.copysign(togo, rudder) if togo > 0.0 else np.nan


@lean_kernel
def _continue_manoeuvre(i: int, scene: Scene) -> None:
    """Roll out the manoeuvre in ``scene.held`` of boat i from its predicted state."""
    held = scene.held
    togo = found_turn(i, scene.next_state[i, L.HEADING], held)
    roll_out(i, i, held[i, 0], togo, held[i, 2], 1, scene)


@lean_kernel
def score_all(scene: Scene) -> None:
    """Score the manoeuvres of all own boats again."""
    for i in range(scene.ours.shape[0]):
        if scene.ours[i]:
            refresh(i, scene)


@lean_kernel
def recheck(scene: Scene) -> None:
    """Score all own boats when movers carry out ``scene.held`` from newly predicted states."""
    for i in range(scene.ours.shape[0]):
        if scene.moving[i]:
            _continue_manoeuvre(i, scene)
    score_all(scene)


@lean_kernel
def roll_out_first(scene: Scene, ahead: int, who: BoolArray) -> None:
    """Give each boat of ``who`` a first manoeuvre: the remembered one, else the first of the family."""
    state = scene.state
    for i in range(state.shape[0]):
        if who[i] and scene.reason[i] == W.STOPPED:
            roll_out(i, i, 1.0, 0.0, 0.0, ahead, scene)
        elif who[i]:
            heading = scene.next_state[i, L.HEADING] if ahead == 1 else state[i, L.HEADING]
            first = IN_MEMORY if remembered(i, ahead, heading, scene) else FAMILY
            rudder, togo, speed = candidate(i, first, scene.command[i, 0], heading, scene)
            roll_out(i, i, rudder, togo, speed, ahead, scene)


@lean_kernel
def assign_manoeuvres(scene: Scene, ahead: int, who: BoolArray) -> bool:
    """Give the boats of ``who`` a manoeuvre from their predicted (ahead = 1) or present states (0).

    From predicted states the first safe manoeuvre is taken; from present ones, which are carried out, the best. Own
    boats outside ``who`` keep their paths. Some boats are not searched again one step ahead. A boat on its backup is
    offered only that backup if its margin was violated (a step ago no manoeuvre did better), or if it now violates
    static constraints alone. Nor is a boat searched that violates margins from pursuers: the other boats' manoeuvres
    do not change those.

    Returns:
        Whether all own boats stay clear of all boats and of static constraints.
    """
    state, ours = scene.state, scene.ours
    n = state.shape[0]
    roll_out_first(scene, ahead, who)
    stale = True
    scene.searched[:] = -1
    changes = 0
    for sweep in range(SWEEPS):
        changed = False
        for i in range(n):
            if not who[i] or scene.reason[i] == W.STOPPED:
                continue
            best_of = ahead == 0 and sweep == 0
            if not best_of:
                refresh(i, scene)
                if needs_no_search(i, sweep, ahead, scene) or all_spent(scene):
                    continue
            if scene.searched[i] == changes and not (ahead == 0 and sweep == 1):  # it would find the same again
                continue
            rudder, togo, speed = scene.manoeuvre[i, 0], scene.manoeuvre[i, 1], scene.manoeuvre[i, 2]
            choose_manoeuvre(i, scene.command[i, 0], ahead, best_of, scene)
            if scene.manoeuvre[i, 0] != rudder or scene.manoeuvre[i, 1] != togo or scene.manoeuvre[i, 2] != speed:
                changes += 1
            scene.searched[i] = changes
            changed = True
        if not changed:
            stale = False
            break
    for i in range(n):
        if ours[i] and (stale or not who[i] or scene.reason[i] == W.STOPPED):
            refresh(i, scene)
    return all_satisfy(CLEAR_OF_ALL, scene)
