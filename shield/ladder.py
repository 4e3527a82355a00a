"""The last stage without a checked answer: escapes, the program's answer if it is better, and the reasons given."""

from __future__ import annotations

import math

import numpy as np

from .certificates.assign import assign_plans, hold
from .certificates.candidates import candidate, remembered
from .certificates.clearance import MARGIN
from .certificates.effort import all_spent
from .certificates.fixed_things import clear_of_near_obstacles
from .certificates.laying import lay_path
from .certificates.manoeuvre import clear_of_boat, told_margin
from .certificates.rating import (
    FIXED_LOST,
    FIXED_THING,
    PAIR_SAFE,
    STRAIGHT_SAFE,
    only_fixed,
    rate_path,
    worst_merit,
    worst_off,
)
from .certificates.surroundings import beyond_field
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

CLEARLY = 1e-2
"""Difference of merit that counts when an answer of the program is weighed against an escape."""

CLEARLY_BY_TABLES = 0.1
"""The same where the boat that is worst off looks opponents up and is short of its margin from them.

A hard turn of one step costs such a boat the speed of three steps, of which a table tells hardly more than it errs by.
A wanted turn sent whenever it looks a little better keeps a hunted boat from ever gaining speed.
"""

WORSE_BY_FIXED = 1e-6
"""The same where only fixed things are at stake: rounding, since what is given away is so in every step."""

STRAYED_M = 0.5
"""A boat beyond the field by more carries out its escape whatever is wanted.

One step of a turn back outwards costs nothing that a margin tells of; taken every other step it costs the boat its
thrust, and herons came back at a sixth of their speed.
"""


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
        if plan.keeps[i]:
            plan.reason[i] = ESCAPE
        elif plan.reason[i] == PASSED or plan.reason[i] == RIGHT_OF_WAY or not unchanged(i, plan):
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
    """Make boat i's command and plan those of its escape; the program's answer is put aside."""
    copy_row(plan.answer[i], plan.commands[i])
    copy_row(plan.answer_held[i], plan.held[i])
    first_move(i, state, boats, tuning, work, plan)
    side, togo = work.plan[i, 0], work.plan[i, 1]
    plan.held[i, 0], plan.held[i, 2] = side, work.plan[i, 2]
    plan.held[i, 1] = state[i, L.HEADING] + math.copysign(togo, side) if togo > 0.0 else np.nan


@lean_kernel
def _join(ours: BoolArray, work: Work, plan: Plan) -> int:
    """Make movers of the boats that passed and whose escapes come too near to those of movers; the movers there are."""
    for i in range(ours.shape[0]):
        j = work.bound[i]
        if ours[i] and work.merit[i] < 0.0 and j >= 0 and ours[j]:
            plan.moving[i] = plan.moving[j] = plan.moving[i] or plan.moving[j]
    return list_movers(plan)


@lean_kernel
def _in_the_way(
    i: int, j: int, slot: int, state: Array, ours: BoolArray, boats: Boats, tuning: Tuning, work: Work
) -> bool:
    """Whether boat i on the path in ``slot`` would come too near to team-mate j on its manoeuvre."""
    if j == i or not ours[j] or not work.near[i, j]:
        return False
    clear_of_boat(i, j, work.path[slot], state, ours, boats, tuning, work, 0.0, 0.0)
    return work.out[MARGIN] < 0.0


@lean_kernel
def _would_do(
    i: int, slot: int, state: Array, ours: BoolArray, boats: Boats, fixed: Fixed, tuning: Tuning, work: Work
) -> bool:
    """Whether boat i on the path in ``slot`` would keep clear of everything but, maybe, of team-mates."""
    for j in range(ours.shape[0]):
        if ours[j]:
            work.near[i, j] = False
    merit = rate_path(i, slot, -1e9, state, ours, boats, fixed, tuning, work)
    for j in range(ours.shape[0]):
        if ours[j]:
            work.near[i, j] = work.near[j, i]
    return merit >= PAIR_SAFE or (merit >= FIXED_LOST and merit > work.merit[i] + CLEARLY)


@lean_kernel
def _make_room(
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
    """Make movers of the boats that passed and lie in the way of an escape that a mover has held until now.

    The mover may since have been given another, which others keep it from: then nobody tells of this one any more. Only
    of one that would do but for team-mates, or they would make room for nothing.
    """
    trial = state.shape[0]
    for m in range(list_movers(plan)):
        i = plan.movers[m]
        heading = state[i, L.HEADING]
        if work.merit[i] >= PAIR_SAFE or not remembered(i, 0, heading, memory):
            continue
        side, togo, speed = candidate(i, 0, 0.0, heading, boats, plans, memory)
        lay_path(i, trial, side, togo, speed, 0, state, boats, tuning, work)
        if not _would_do(i, trial, state, ours, boats, fixed, tuning, work):
            continue
        for j in range(ours.shape[0]):
            if not plan.moving[j] and _in_the_way(i, j, trial, state, ours, boats, tuning, work):
                plan.moving[j] = True
    return list_movers(plan)


@lean_kernel
def _assign_escapes(
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
    """Escapes of the movers from the present state; whether all boats of ours then keep clear.

    Opponents are left where boats with tables look them up on such escapes.
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
def _clearly(before: float, ours: BoolArray, boats: Boats, work: Work) -> float:
    """Merit by which the program's answer (before) must exceed the escapes', which are held now, to be kept."""
    i = worst_off(ours, work)
    if i >= 0 and boats.look[i] > 0 and work.merit[i] >= STRAIGHT_SAFE and before < FIXED_LOST:
        return CLEARLY_BY_TABLES
    return CLEARLY


@lean_kernel
def _strayed(count: int, state: Array, fixed: Fixed, plan: Plan) -> bool:
    """Whether some mover is well beyond the field."""
    for m in range(count):
        i = plan.movers[m]
        if beyond_field(state[i, L.X], state[i, L.Y], fixed.field) > STRAYED_M:
            return True
    return False


@lean_kernel
def _none_worse_off(ours: BoolArray, work: Work, plan: Plan) -> bool:
    """Whether every boat of ours had as much by the program's answer, ``plan.merit``, as it has now."""
    worse = False
    for i in range(ours.shape[0]):
        worse = worse or (ours[i] and plan.merit[i] < min(work.merit[i], PAIR_SAFE) - WORSE_BY_FIXED)
    return not worse


@lean_kernel
def _better_than_escapes(
    before: float, count: int, state: Array, ours: BoolArray, boats: Boats, fixed: Fixed, work: Work, plan: Plan
) -> bool:
    """Whether the program's answer, of the worst merit ``before``, is to be kept rather than the escapes held now.

    Where only fixed things are at stake, no boat may have less by it: what one is beyond an edge anyway is no leave for
    another to go beyond its own.
    """
    if before > worst_merit(ours, work) + _clearly(before, ours, boats, work):
        return True
    return before >= FIXED_LOST and _none_worse_off(ours, work, plan) and not _strayed(count, state, fixed, plan)


@lean_kernel
def _take_answers(count: int, work: Work, plan: Plan) -> None:
    """Give the movers the program's answers; their escapes are put aside, and whether they keep everything."""
    for m in range(count):
        i = plan.movers[m]
        plan.keeps[i] = work.merit[i] >= FIXED_LOST
        copy_row(plan.escape[i], plan.commands[i])
        copy_row(plan.escape_held[i], plan.held[i])
        copy_row(plan.commands[i], plan.answer[i])
        copy_row(plan.held[i], plan.answer_held[i])


@lean_kernel
def _nobody_loses(i: int, ours: BoolArray, work: Work, plan: Plan) -> bool:
    """Whether boat i now keeps everything, and every other boat of ours what it kept before."""
    for j in range(ours.shape[0]):
        if ours[j] and j != i and work.merit[j] < min(plan.merit[j], PAIR_SAFE) - WORSE_BY_FIXED:
            return False
    return work.merit[i] >= FIXED_LOST


@lean_kernel
def _take_escapes_that_keep(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> None:
    """Give a mover its escape after all where that keeps everything, its answer does not, and nobody loses by it.

    The worst margin of the team decides between answers and escapes; what a boat far away cannot keep is no reason for
    this one to give up what it can.
    """
    for m in range(count):
        i = plan.movers[m]
        if not plan.keeps[i] or work.merit[i] >= FIXED_LOST or all_spent(tuning, work):
            plan.keeps[i] = False
            continue
        copy_row(plan.merit, work.merit)
        copy_row(plan.commands[i], plan.escape[i])
        copy_row(plan.held[i], plan.escape_held[i])
        check(count, state, ours, boats, fixed, tuning, memory, work, plan)
        if not _nobody_loses(i, ours, work, plan):
            plan.keeps[i] = False
            copy_row(plan.commands[i], plan.answer[i])
            copy_row(plan.held[i], plan.answer_held[i])
            check(count, state, ours, boats, fixed, tuning, memory, work, plan)


@lean_kernel
def ladder(
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
    """No checked answer of the program: the movers take the escape that keeps the worst margin largest.

    Escapes are searched from the present state, the one under way first. When even the best leaves somebody short
    (reason BEST_EFFORT) it is still carried out: avoidance does not switch itself off. A program's answer that
    leaves a better worst margin than any escape is kept (reason QP_RELAXED), but for boats that only their escape keeps
    safe. When only fixed things are at stake and
    no escape does better by them than the program's answer or the wanted command, that one is sent; an escape that
    keeps them is carried out only as far as they ask for, see `easing`.

    Boats that passed have escapes that fit the others' after the wanted commands, maybe not those they had: where
    an escape that a mover has, or has held until now, would bring it into one of them, that boat is a mover, too. All
    together had escapes that fit at the last decision, and these are what is tried first.
    """
    before, eases = worst_merit(ours, work), only_fixed(ours, work)
    copy_row(plan.merit, work.merit)
    for i in range(ours.shape[0]):
        if ours[i]:
            hold(i, plan.held, work)
    good = False
    for _ in range(ours.shape[0]):
        good = _assign_escapes(count, state, ours, boats, fixed, plans, tuning, memory, work, plan)
        movers = count
        if not good:
            _join(ours, work, plan)
            movers = _make_room(state, ours, boats, fixed, plans, tuning, memory, work, plan)
        if movers == count or all_spent(tuning, work):
            break
        count = movers
    run_opponents(1, ours, state, boats, tuning, work, work.ways)
    for m in range(count):
        set_off(plan.movers[m], state, boats, tuning, work, plan)
    check(count, state, ours, boats, fixed, tuning, memory, work, plan)
    if not good and _better_than_escapes(before, count, state, ours, boats, fixed, work, plan):
        _take_answers(count, work, plan)
        check(count, state, ours, boats, fixed, tuning, memory, work, plan)
        _take_escapes_that_keep(count, state, ours, boats, fixed, tuning, memory, work, plan)
        mark_relaxed(count, state, boats, fixed, work, plan)
        return
    for m in range(count):
        i = plan.movers[m]
        plan.reason[i] = ESCAPE if work.merit[i] >= FIXED_LOST else BEST_EFFORT
        plan.slack_m[i] = _given_up(i, state, boats, fixed, work)
    if good and eases and worst_merit(ours, work) >= PAIR_SAFE and not all_spent(tuning, work):
        ease(count, state, ours, boats, fixed, tuning, memory, work, plan)
