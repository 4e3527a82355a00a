"""Which backup manoeuvre each boat of ours holds: found one boat at a time, the others' kept, until all fit."""

from __future__ import annotations

import math

import numpy as np

from ..jit import Array, BoolArray, copy_row, lean_kernel
from ..memory import Memory
from ..platforms import layout as L
from ..scene import Scene
from ..work import Work
from .candidates import DONE_DEG, candidate, kept_turn, preference, remembered
from .effort import all_spent
from .laying import lay_path, refused_by_tables, run_out, set_out
from .paths import angle_to_go
from .rank import PAIR_SAFE, STRAIGHT_SAFE, rank_path

SWEEPS = 3

SAME_RANK = 1e-9
"""Manoeuvres whose ranks differ by no more, m, are alike: rounding, which differs from place to place, decides
nothing. Of such ones the first is taken, to starboard before to port, as the rules of the road ask."""


@lean_kernel
def _take(i: int, slot: int, rank: float, work: Work) -> None:
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
    work.rank[i] = rank


@lean_kernel
def choose_plan(i: int, wanted_mps: float, done: int, exhaustive: bool, scene: Scene) -> None:
    """Give boat i a manoeuvre: the first that is safe, or with ``exhaustive`` the best of all.

    The one under way is left only for one that is better by the hysteresis, so that a side once taken is kept; with a
    table the choice is made anew at every step, so that is asked of the other side only. What a table refuses one step
    on it refuses for every manoeuvre: then the first that keeps clear of all else will do.

    Once the decision has cost its limit the best so far will do, see `effort`.
    """
    state, boats, tuning, memory, work = scene.state, scene.boats, scene.tuning, scene.memory, scene.work
    trial = state.shape[0]
    heading = work.next_state[i, L.HEADING] if done == 1 else state[i, L.HEADING]
    best = -1e9
    compared = boats.table_steps[i] > 0 and done == 0  # one step on the tables say the same of all manoeuvres
    for p in range(boats.n_plans[i] + 1):
        if p == 0 and not remembered(i, done, heading, memory):
            continue
        side, togo, speed = candidate(i, p, wanted_mps, heading, scene)
        set_out(i, trial, side, togo, speed, done, scene)
        if compared and refused_by_tables(i, trial, best, scene):
            continue
        run_out(i, trial, done, scene)
        rank = rank_path(i, trial, best, scene)
        kept_rank = rank + preference(i, p, side, togo, rank, scene)
        if kept_rank > best + SAME_RANK:
            best = kept_rank
            _take(i, trial, rank, work)
        sealed = done == 1 and work.sealed[trial] and kept_rank == rank
        if not exhaustive and (rank >= PAIR_SAFE or sealed):
            return
        if all_spent(tuning, work):
            return


@lean_kernel
def refresh(i: int, scene: Scene) -> None:
    """Rate boat i's plan again against the others' present plans."""
    scene.work.rank[i] = rank_path(i, i, -1e9, scene)


@lean_kernel
def settled(i: int, sweep: int, exhaustive: bool, memory: Memory, work: Work) -> bool:
    """Whether no other manoeuvre is to be searched for boat i in this sweep, see `assign_plans`."""
    was_short = memory.kept[i] and memory.backing_up[i] and memory.margin_m[i] < 0.0
    if work.rank[i] >= PAIR_SAFE or (sweep > 0 and work.rank[i] >= STRAIGHT_SAFE):
        return True
    return not exhaustive and was_short


@lean_kernel
def hold(i: int, held: Array, work: Work) -> None:
    """Note the manoeuvre boat i has from its predicted state: side, heading it ends on (NaN: no turn), speed."""
    side, togo = work.plan[i, 0], work.plan[i, 1]
    held[i, 0], held[i, 2] = side, work.plan[i, 2]
    held[i, 1] = work.next_state[i, L.HEADING] + math.copysign(togo, side) if togo > 0.0 else np.nan


@lean_kernel
def recheck(scene: Scene) -> bool:
    """Whether all boats of ours keep clear when movers go on, from newly predicted states, as they were.

    Each is offered the manoeuvre in ``plan.held`` and failing that the one in memory.
    """
    state, ours, memory, work = scene.state, scene.ours, scene.memory, scene.work
    who, held = scene.plan.moving, scene.plan.held
    n, trial = state.shape[0], state.shape[0]
    for i in range(n):
        if who[i]:
            togo = 0.0
            if not math.isnan(held[i, 1]):
                togo = angle_to_go(work.next_state[i, L.HEADING], held[i, 1], held[i, 0])
                togo = 0.0 if togo > DONE_DEG else togo
            lay_path(i, i, held[i, 0], togo, held[i, 2], 1, scene)
    for i in range(n):
        if not who[i]:
            continue
        refresh(i, scene)
        heading = work.next_state[i, L.HEADING]
        if work.rank[i] >= PAIR_SAFE or not remembered(i, 1, heading, memory):
            continue
        lay_path(i, trial, memory.side[i], kept_turn(i, heading, memory), memory.speed_mps[i], 1, scene)
        rank = rank_path(i, trial, work.rank[i], scene)
        if rank > work.rank[i]:
            _take(i, trial, rank, work)
    good = True
    for i in range(n):
        if ours[i]:
            refresh(i, scene)
            good = good and work.rank[i] >= PAIR_SAFE
    return good


@lean_kernel
def lay_first(scene: Scene, done: int, who: BoolArray) -> None:
    """Give each boat of ``who`` the manoeuvre to begin with: the one in memory, else the first of the family."""
    state, memory, work = scene.state, scene.memory, scene.work
    for i in range(state.shape[0]):
        if who[i]:
            heading = work.next_state[i, L.HEADING] if done == 1 else state[i, L.HEADING]
            first = 0 if remembered(i, done, heading, memory) else 1
            side, togo, speed = candidate(i, first, scene.plan.commands[i, 0], heading, scene)
            lay_path(i, i, side, togo, speed, done, scene)


@lean_kernel
def assign_plans(scene: Scene, done: int, exhaustive: bool, who: BoolArray) -> bool:
    """Give the boats of ``who`` a manoeuvre, from their predicted (done = 1) or present states (0).

    Boats of ours outside ``who`` keep the paths they have. A boat that was short of its margin on its backup is only
    offered that backup, unless ``exhaustive``: what all manoeuvres could not do a step ago is not searched twice. Nor
    is a boat whose trouble are pursuers, which the others' manoeuvres do not change.

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
            if not who[i]:
                continue
            if not (exhaustive and sweep == 0):
                refresh(i, scene)
                if settled(i, sweep, exhaustive, memory, work) or all_spent(tuning, work):
                    continue
            if work.searched[i] == changes and not (exhaustive and sweep == 1):  # it would find the same again
                continue
            side, togo, speed = work.plan[i, 0], work.plan[i, 1], work.plan[i, 2]
            choose_plan(i, scene.plan.commands[i, 0], done, exhaustive and sweep == 0, scene)
            if work.plan[i, 0] != side or work.plan[i, 1] != togo or work.plan[i, 2] != speed:
                changes += 1
            work.searched[i] = changes
            changed = True
        if not changed:
            stale = False
            break
    good = True
    for i in range(n):
        if ours[i]:
            if stale or not who[i]:
                refresh(i, scene)
            good = good and work.rank[i] >= PAIR_SAFE
    return good
