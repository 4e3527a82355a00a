"""The choice: of all commands that could be sent, the one that keeps the most, and of those the least change.

Candidates are the wanted commands, the program's answers, the backup manoeuvres, and what lies between these and the
wanted commands. Each is checked by the full model, and each boat of ours then has a rank (`certificates.rating`). One
candidate is better than another when its worst-off boat is, when those are alike its second worst, and so on; of alike
ones that with less change is taken, in the order in which they are named here.

Boats are ranked together since a manoeuvre of one may cost another its own. What is kept by all is kept whatever else
could be had: above `PAIR_SAFE` all ranks are alike.
"""

from __future__ import annotations

import math

import numpy as np

from .certificates.assign import assign_plans, hold
from .certificates.clearance import MARGIN
from .certificates.effort import all_spent
from .certificates.fixed_things import clear_of_near_obstacles
from .certificates.manoeuvre import told_margin
from .certificates.rating import FIXED_LOST, FIXED_THING, PAIR_SAFE, worst_merit
from .certificates.values import run_opponents
from .easing import ease
from .jit import Array, BoolArray, copy_row, lean_kernel
from .linearised import check, list_movers
from .memory import Memory
from .plan import BEST_EFFORT, ESCAPE, PASSED, QP_RELAXED, RIGHT_OF_WAY, Plan, unchanged
from .platforms import layout as L
from .platforms.actuator import command_for_turn, full_turn
from .scene import Boats, Fixed, Tuning
from .work import Work

WORTHLESS = -1e12
"""Rank of no candidate at all."""

ALIKE = 1e-6
"""Ranks that differ by no more are alike: rounding decides nothing."""


@lean_kernel
def note_candidate(ours: BoolArray, work: Work, plan: Plan) -> None:
    """Keep the candidate that was checked last if it is better than the one kept."""
    if not _better(ours, work, plan):
        return
    for i in range(ours.shape[0]):
        if ours[i]:
            plan.merit[i] = work.merit[i]
            copy_row(plan.answer[i], plan.commands[i])
            hold(i, plan.answer_held, work)


@lean_kernel
def forget_candidates(plan: Plan) -> None:
    """Keep none: any is better."""
    plan.merit[:] = WORTHLESS


@lean_kernel
def _better(ours: BoolArray, work: Work, plan: Plan) -> bool:
    """Whether what the boats have now is better than what they have by the candidate kept, ``plan.merit``."""
    n, level = ours.shape[0], -math.inf
    while True:
        now, kept = _least_above(level, work.merit, ours, n), _least_above(level, plan.merit, ours, n)
        if now >= PAIR_SAFE and kept >= PAIR_SAFE:
            return False
        if abs(now - kept) > ALIKE:
            return now > kept
        level = max(now, kept)


@lean_kernel
def _least_above(level: float, merit: Array, ours: BoolArray, n: int) -> float:
    """Least rank of a boat of ours beyond a level; infinite where there is none."""
    least = math.inf
    for i in range(n):
        if ours[i] and merit[i] < least and merit[i] > level:
            least = merit[i]
    return least


@lean_kernel
def opposed(ours: BoolArray, plan: Plan) -> bool:
    """Whether an opponent is what some boat's wanted command is short of.

    Least changes are for those who stand still or decide with us. An opponent that is only just kept off is so again in
    the next step, and a boat that gives way as little as it may in each gives way for longer.
    """
    for i in range(ours.shape[0]):
        if plan.cause[i] >= 0 and not ours[plan.cause[i]]:
            return True
    return False


@lean_kernel
def mark_answer(count: int, reason: int, plan: Plan) -> None:
    """Give the reason to the movers whose command changed."""
    for m in range(count):
        i = plan.movers[m]
        if not unchanged(i, plan):
            plan.reason[i] = reason


@lean_kernel
def _given_up(i: int, state: Array, boats: Boats, fixed: Fixed, work: Work) -> float:
    """What boat i is short of its distance from boats and fixed things, m."""
    least = min(told_margin(i, state, work), work.fixed[i, MARGIN])
    if work.merit[i] < FIXED_LOST and work.bound[i] == FIXED_THING:  # of an obstacle near in time nothing is noted
        clear_of_near_obstacles(i, i, state, boats, fixed, work, work.spare2)
        least = min(least, work.spare2[MARGIN])
    return max(0.0, -least)


@lean_kernel
def mark_relaxed(count: int, state: Array, boats: Boats, fixed: Fixed, work: Work, plan: Plan) -> None:
    """Say of all movers that not everything could be kept, also of those whose wanted command is the best there is."""
    for m in range(count):
        i = plan.movers[m]
        if plan.reason[i] == PASSED or plan.reason[i] == RIGHT_OF_WAY or not unchanged(i, plan):
            plan.reason[i] = QP_RELAXED
        plan.slack_m[i] = _given_up(i, state, boats, fixed, work)


@lean_kernel
def first_move(i: int, state: Array, boats: Boats, tuning: Tuning, work: Work, plan: Plan) -> None:
    """Command of the first step of boat i's manoeuvre, through the autopilot's inverse."""
    side, togo, speed = work.plan[i, 0], work.plan[i, 1], work.plan[i, 2]
    if togo > 0.0:
        togo = min(togo, abs(side) * full_turn(boats.params[i], state[i], speed, tuning.dt_s))
    plan.commands[i, 0] = speed
    plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, math.copysign(togo, side), tuning.dt_s)


@lean_kernel
def set_off(i: int, state: Array, boats: Boats, tuning: Tuning, work: Work, plan: Plan) -> None:
    """Make boat i's command and plan those of its backup manoeuvre."""
    first_move(i, state, boats, tuning, work, plan)
    side, togo = work.plan[i, 0], work.plan[i, 1]
    plan.held[i, 0], plan.held[i, 2] = side, work.plan[i, 2]
    plan.held[i, 1] = state[i, L.HEADING] + math.copysign(togo, side) if togo > 0.0 else np.nan


@lean_kernel
def _join(ours: BoolArray, work: Work, plan: Plan) -> int:
    """Make movers of the boats that passed and whose backups come too near to those of movers; the movers there are."""
    for i in range(ours.shape[0]):
        j = work.bound[i]
        if ours[i] and work.merit[i] < 0.0 and j >= 0 and ours[j]:
            plan.moving[i] = plan.moving[j] = plan.moving[i] or plan.moving[j]
    return list_movers(plan)


@lean_kernel
def _assign_backups(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> bool:
    """Backups of the movers from the present state; whether all boats of ours then keep clear.

    Opponents are left where boats with tables look them up on such manoeuvres.
    """
    look = 1
    for i in range(ours.shape[0]):
        work.target[i] = 0.0
        work.mate_target_m[i] = 0.0
    for m in range(count):
        i = plan.movers[m]
        work.threat_target_m[i, :] = 0.0
        work.joint_target_m[i] = 0.0
        work.fixed_target_m[i] = 0.0
        look = max(look, boats.look[i])
    run_opponents(look, ours, state, boats, tuning, work, work.ways)
    return assign_plans(plan.commands, 0, True, plan.moving, state, ours, boats, fixed, plans, tuning, memory, work)


@lean_kernel
def _back_up(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> int:
    """Make the candidate of all movers' backups and check it; returns how many movers there are.

    All boats of ours had backups that fit at the last decision, and these are tried first. Where the new ones do not
    fit those of boats whose wanted commands passed, these boats take part, too.
    """
    for _ in range(ours.shape[0]):
        good = _assign_backups(count, state, ours, boats, fixed, plans, tuning, memory, work, plan)
        movers = count if good else _join(ours, work, plan)
        if movers == count or all_spent(tuning, work):
            break
        count = movers
    run_opponents(1, ours, state, boats, tuning, work, work.ways)
    for m in range(count):
        set_off(plan.movers[m], state, boats, tuning, work, plan)
    check(count, state, ours, boats, fixed, tuning, memory, work, plan)
    return count


@lean_kernel
def choose(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> None:
    """Send the best candidate where neither the wanted commands nor an answer of the program keep everything.

    The backups, if they are better than these, and as little of them as keeps what they keep (reason ESCAPE,
    BEST_EFFORT where something is short all the same); else the best of these (QP_RELAXED).
    """
    count = _back_up(count, state, ours, boats, fixed, plans, tuning, memory, work, plan)
    if not _better(ours, work, plan):
        for m in range(count):
            copy_row(plan.commands[plan.movers[m]], plan.answer[plan.movers[m]])
            copy_row(plan.held[plan.movers[m]], plan.answer_held[plan.movers[m]])
        check(count, state, ours, boats, fixed, tuning, memory, work, plan)
        mark_relaxed(count, state, boats, fixed, work, plan)
        return
    for m in range(count):
        i = plan.movers[m]
        plan.reason[i] = ESCAPE if work.merit[i] >= FIXED_LOST else BEST_EFFORT
        plan.slack_m[i] = _given_up(i, state, boats, fixed, work)
    if not opposed(ours, plan) and worst_merit(ours, work) >= PAIR_SAFE and not all_spent(tuning, work):
        ease(count, state, ours, boats, fixed, tuning, memory, work, plan)
