"""Which backup manoeuvre each boat of ours holds: found one boat at a time, the others' kept, until all fit."""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, BoolArray, copy_row, lean_kernel
from ..memory import Memory
from ..plan import STOPPED
from ..platforms import layout as L
from ..scene import Scene
from ..work import Work
from .candidates import FAMILY, FOUND, IN_MEMORY, candidate, found_turn, remembered
from .effort import all_spent
from .laying import lay_path, refused_by_tables, run_out, set_out
from .rank import ALL, OBSTACLES, OPPONENTS, WORST, Rank, all_keep, better, rank_path

SWEEPS = 3


@lean_kernel
def _take(i: int, slot: int, rank: Rank, work: Work) -> None:
    """Make the trial in ``slot`` boat i's plan."""
    for k in range(work.path.shape[1]):
        copy_row(work.path[i, k], work.path[slot, k])
    copy_row(work.plan[i], work.plan[slot])
    copy_row(work.place[i], work.place[slot])
    copy_row(work.ready[i], work.ready[slot])
    copy_row(work.clear[i], work.clear[slot])
    copy_row(work.static[i], work.static[slot])
    work.threat_m[i] = work.threat_m[slot]
    work.fails[i] = work.fails[slot]
    copy_row(work.threats_m[i], work.threats_m[slot])
    work.joint_m[i] = work.joint_m[slot]
    work.threat_by[i] = work.threat_by[slot]
    work.pursuers_known[i] = work.pursuers_known[slot]
    work.sealed[i] = work.sealed[slot]
    work.bound[i] = work.bound[slot]
    work.kept[i], work.worth_m[i] = rank


@lean_kernel
def choose_plan(i: int, wanted_mps: float, done: int, best_of: bool, scene: Scene) -> None:
    """Give boat i a manoeuvre: the first that is safe, or with ``best_of`` the best.

    Of manoeuvres that are alike the first is taken, to starboard before to port, as the rules of the road ask. The best
    that screening found for the state one step on is good enough from here: where that, or the one in memory, is safe
    no others are looked at. By tables manoeuvres differ from here only, so where an opponent is what the wanted
    command is short of, all are. What a table refuses one step on it refuses for every manoeuvre: then the first that
    keeps clear of all else will do.

    Once the decision has cost its limit the best so far will do, see `effort`.
    """
    state, boats, tuning, memory, work = scene.state, scene.boats, scene.tuning, scene.memory, scene.work
    trial = state.shape[0]
    heading = work.next_state[i, L.HEADING] if done == 1 else state[i, L.HEADING]
    best = WORST
    cause = scene.plan.cause[i]
    compared = boats.table_steps[i] > 0 and done == 0 and cause >= 0 and not scene.ours[cause]
    for p in range(boats.n_plans[i] + FAMILY):
        if p == IN_MEMORY and not remembered(i, done, heading, memory):
            continue
        if p == FOUND and (done == 1 or compared):
            continue
        if best.kept == ALL and (not best_of or (p == FAMILY and not compared)):
            return
        side, togo, speed = candidate(i, p, wanted_mps, heading, scene)
        set_out(i, trial, side, togo, speed, done, scene)
        if compared and refused_by_tables(i, trial, best, scene):
            continue
        run_out(i, trial, done, scene)
        rank = rank_path(i, trial, best, scene)
        if better(rank, best):
            best = rank
            _take(i, trial, rank, work)
        if (done == 1 and work.sealed[trial]) or all_spent(tuning, work):
            return


@lean_kernel
def refresh(i: int, scene: Scene) -> None:
    """Rate boat i's plan again against the others' present plans."""
    work = scene.work
    work.kept[i], work.worth_m[i] = rank_path(i, i, WORST, scene)


@lean_kernel
def settled(i: int, sweep: int, done: int, memory: Memory, work: Work) -> bool:
    """Whether no other manoeuvre is to be searched for boat i in this sweep, see `assign_plans`."""
    was_short = (
        memory.has_backup[i] and memory.backing_up[i] and (memory.margin_m[i] < 0.0 or work.kept[i] >= OPPONENTS)
    )
    if work.kept[i] == ALL or (sweep > 0 and work.kept[i] >= OBSTACLES):
        return True
    return done == 1 and was_short


@lean_kernel
def hold(i: int, held: Array, work: Work) -> None:
    """Note the manoeuvre boat i has from its predicted state: side, heading it ends on (NaN: no turn), speed."""
    side, togo = work.plan[i, 0], work.plan[i, 1]
    held[i, 0], held[i, 2] = side, work.plan[i, 2]
    held[i, 1] = work.next_state[i, L.HEADING] + math.copysign(togo, side) if togo > 0.0 else np.nan


@lean_kernel
def _go_on(i: int, scene: Scene) -> None:
    """Lay the path of boat i on the manoeuvre in ``plan.held`` from its predicted state."""
    held = scene.plan.held
    togo = found_turn(i, scene.work.next_state[i, L.HEADING], held)
    lay_path(i, i, held[i, 0], togo, held[i, 2], 1, scene)


@lean_kernel
def rate(scene: Scene) -> None:
    """Rate the plans of all boats of ours again."""
    for i in range(scene.ours.shape[0]):
        if scene.ours[i]:
            refresh(i, scene)


@lean_kernel
def recheck(scene: Scene) -> None:
    """Rate all boats of ours when movers carry out ``plan.held`` from newly predicted states."""
    for i in range(scene.ours.shape[0]):
        if scene.plan.moving[i]:
            _go_on(i, scene)
    rate(scene)


@lean_kernel
def lay_first(scene: Scene, done: int, who: BoolArray) -> None:
    """Give each boat of ``who`` the manoeuvre to begin with: the one in memory, else the first of the family."""
    state, memory, work = scene.state, scene.memory, scene.work
    for i in range(state.shape[0]):
        if who[i] and scene.plan.reason[i] == STOPPED:
            lay_path(i, i, 1.0, 0.0, 0.0, done, scene)
        elif who[i]:
            heading = work.next_state[i, L.HEADING] if done == 1 else state[i, L.HEADING]
            first = IN_MEMORY if remembered(i, done, heading, memory) else FAMILY
            side, togo, speed = candidate(i, first, scene.plan.commands[i, 0], heading, scene)
            lay_path(i, i, side, togo, speed, done, scene)


@lean_kernel
def assign_plans(scene: Scene, done: int, who: BoolArray) -> bool:
    """Give the boats of ``who`` a manoeuvre from their predicted (done = 1) or present states (0).

    From predicted ones that is the first that is safe, from present ones, which are carried out, the best.
    Boats of ours outside ``who`` keep the paths they have. One step on, a boat that was on its backup is only
    offered that if it was short of its margin, since what all manoeuvres could not do a step ago is not searched twice,
    or if it now is short of static constraints alone. Nor is a boat whose trouble are pursuers, which the others'
    manoeuvres do not change.

    Returns:
        Whether all boats of ours keep clear of all boats and of static constraints.
    """
    state, ours, tuning, memory, work = scene.state, scene.ours, scene.tuning, scene.memory, scene.work
    n = state.shape[0]
    lay_first(scene, done, who)
    stale = True
    work.searched[:] = -1
    changes = 0
    for sweep in range(SWEEPS):
        changed = False
        for i in range(n):
            if not who[i] or scene.plan.reason[i] == STOPPED:
                continue
            best_of = done == 0 and sweep == 0
            if not best_of:
                refresh(i, scene)
                if settled(i, sweep, done, memory, work) or all_spent(tuning, work):
                    continue
            if work.searched[i] == changes and not (done == 0 and sweep == 1):  # it would find the same again
                continue
            side, togo, speed = work.plan[i, 0], work.plan[i, 1], work.plan[i, 2]
            choose_plan(i, scene.plan.commands[i, 0], done, best_of, scene)
            if work.plan[i, 0] != side or work.plan[i, 1] != togo or work.plan[i, 2] != speed:
                changes += 1
            work.searched[i] = changes
            changed = True
        if not changed:
            stale = False
            break
    for i in range(n):
        if ours[i] and (stale or not who[i] or scene.plan.reason[i] == STOPPED):
            refresh(i, scene)
    return all_keep(ALL, ours, work)
