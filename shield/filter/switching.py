"""Where the wanted commands do not keep everything: the backups, a joint plan for all boats of ours.

A command is sent only with a verified joint plan behind it: a manoeuvre for every boat of ours that keeps clear of
everything from the state one step after it. When the wanted commands have none, the plan of the last decision is gone
on with, or a better one. So a verified plan, once there, is there at every step, unless an opponent does what none was
asked to keep clear of.

Before opponents backups are carried out in full: of those who do not decide with us too little is known. One that is
only just kept off is so again in the next step, and a boat that gives way as little as it may in each gives way for
longer. Of other backups as little is carried out as will do, see `least_change` and `easing`.

That is the switching of backup filters: Gurriet et al. 2020 (IEEE Access 8), Agrawal, Chen, Panagou 2024 (gatekeeper).
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.assign import assign_plans
from ..backup.candidates import IN_MEMORY, candidate, remembered
from ..backup.laying import lay_path
from ..backup.rank import ALL, BOATS, OBSTACLES, OPPONENTS, WORST, Rank, better, rank_of, rank_path
from ..barriers.boats import reported_margin
from ..barriers.clearance import MARGIN
from ..barriers.static import clear_of_near_obstacles
from ..barriers.value_function import run_opponents
from ..jit import lean_kernel
from ..plan import BACKUP, BEST_EFFORT, STOPPED, Plan
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn, full_turn
from ..scene import Scene
from .exact_check import check


@lean_kernel
def pick_movers(scene: Scene) -> int:
    """Boats whose certificate fails, and the team-mates it fails against; once in, a boat stays in."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    n = ours.shape[0]
    for i in range(n):
        if ours[i] and work.kept[i] < ALL:
            plan.moving[i] = True
            j = work.bound[i]
            if j >= 0 and ours[j]:
                plan.moving[j] = True
    return list_movers(plan)


@lean_kernel
def list_movers(plan: Plan) -> int:
    """List the boats marked as movers, and number them; returns how many they are."""
    count = 0
    for i in range(plan.moving.shape[0]):
        plan.place[i] = -1
        if plan.moving[i]:
            plan.movers[count], plan.place[i] = i, count
            count += 1
    return count


@lean_kernel
def _given_up(i: int, scene: Scene) -> float:
    """What boat i is short of its distance from boats and static constraints, m."""
    state, work = scene.state, scene.work
    least = min(reported_margin(i, state, work), work.static[i, MARGIN])
    if work.kept[i] == BOATS:  # of an obstacle near in time nothing else is noted
        clear_of_near_obstacles(i, i, scene, 0.0, work.spare2)
        least = min(least, work.spare2[MARGIN])
    return max(0.0, -least)


@lean_kernel
def set_off(i: int, scene: Scene) -> None:
    """Make boat i's command and plan those of its backup: the first step of it, through the autopilot's inverse."""
    state, boats, tuning, work, plan = scene.state, scene.boats, scene.tuning, scene.work, scene.plan
    side, togo, speed = work.plan[i, 0], work.plan[i, 1], work.plan[i, 2]
    plan.held[i, 0], plan.held[i, 1], plan.held[i, 2] = side, np.nan, speed
    if togo > 0.0:
        plan.held[i, 1] = state[i, L.HEADING] + math.copysign(togo, side)
        togo = min(togo, abs(side) * full_turn(boats.params[i], state[i], speed, tuning.dt_s))
    plan.commands[i, 0] = speed
    plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, math.copysign(togo, side), tuning.dt_s)


@lean_kernel
def _could_keep(i: int, slot: int, scene: Scene) -> Rank:
    """Rank of boat i's path in ``slot`` if team-mates whose wanted commands passed were not there."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    for j in range(ours.shape[0]):
        if ours[j] and not plan.moving[j]:
            work.near[i, j] = False
    rank = rank_path(i, slot, WORST, scene)
    for j in range(ours.shape[0]):
        if ours[j] and not plan.moving[j]:
            work.near[i, j] = work.near[j, i]
    return rank


@lean_kernel
def _passed_are_in_the_way(count: int, scene: Scene) -> bool:
    """Whether some mover would keep more if team-mates whose wanted commands passed were not there.

    A boat that opponents or static constraints leave no way out is helped by nobody who gives up what was wanted.
    """
    state, memory, work, plan = scene.state, scene.memory, scene.work, scene.plan
    trial = state.shape[0]
    for m in range(count):
        i = plan.movers[m]
        if work.kept[i] == ALL:
            continue
        if better(_could_keep(i, i, scene), rank_of(i, work)):
            return True
        heading = state[i, L.HEADING]
        if not remembered(i, 0, heading, memory):
            continue
        side, togo, speed = candidate(i, IN_MEMORY, 0.0, heading, scene)
        lay_path(i, trial, side, togo, speed, 0, scene)
        if better(_could_keep(i, trial, scene), rank_of(i, work)):
            return True
    return False


@lean_kernel
def _join(scene: Scene) -> int:
    """Make movers of the boats of ours that could meet movers; returns how many movers there are."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        for m in range(ours.shape[0]):
            if ours[i] and plan.place[m] >= 0 and work.near[i, m]:
                plan.moving[i] = True
    return list_movers(plan)


@lean_kernel
def _join_short(scene: Scene) -> int:
    """Make movers of the boats of ours that passed and that the movers' backups come too near; returns as `_join`."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        if ours[i] and work.kept[i] < OBSTACLES:
            plan.moving[i] = True
    return list_movers(plan)


@lean_kernel
def _assign_backups(count: int, scene: Scene) -> bool:
    """Backups of the movers from the present state; whether all boats of ours then keep clear.

    Opponents are left where boats with tables look them up on such manoeuvres.
    """
    ours, boats, work, plan = scene.ours, scene.boats, scene.work, scene.plan
    table_steps = 1
    for i in range(ours.shape[0]):
        work.target[i] = 0.0
        work.mate_target_m[i] = 0.0
    for m in range(count):
        i = plan.movers[m]
        work.threat_target_m[i, :] = 0.0
        work.joint_target_m[i] = 0.0
        work.static_target_m[i] = 0.0
        table_steps = max(table_steps, boats.table_steps[i])
    run_opponents(table_steps, scene)
    return assign_plans(scene, 0, plan.moving)


@lean_kernel
def _find_backups(count: int, scene: Scene) -> None:
    """Make the candidate of all movers' backups and check it.

    All boats of ours had backups that fit at the last decision, and these are tried first. Those of the movers need not
    fit what boats have whose wanted commands passed: where these are in the way, or are themselves too near them, they
    take part, too.
    """
    ours, plan = scene.ours, scene.plan
    for _ in range(ours.shape[0]):
        if _assign_backups(count, scene):
            break
        movers = _join(scene) if _passed_are_in_the_way(count, scene) else _join_short(scene)
        if movers == count:
            break
        count = movers
    run_opponents(1, scene)
    for m in range(count):
        set_off(plan.movers[m], scene)
    check(scene)


@lean_kernel
def back_up(scene: Scene) -> None:
    """Make backups the commands of the boats that are short of something, and of those in whose way these are.

    The reason is BACKUP, of boats that are short of something all the same BEST_EFFORT: avoidance does not switch
    itself off.
    """
    ours, work, plan = scene.ours, scene.work, scene.plan
    _find_backups(pick_movers(scene), scene)
    for i in range(ours.shape[0]):
        keeps = work.kept[i] >= OPPONENTS
        if ours[i] and plan.reason[i] != STOPPED and (plan.moving[i] or not keeps):
            plan.reason[i] = BACKUP if keeps else BEST_EFFORT
            plan.slack_m[i] = _given_up(i, scene)
