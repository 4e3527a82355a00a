"""Laying a manoeuvre of a boat into a slot of the working memory: where it is looked up, and its path."""

from __future__ import annotations

from ..barriers.clearance import FAR
from ..barriers.foreseen import may_pursue
from ..barriers.opponents import first_then_rest
from ..barriers.value_function import margin_at_once, set_place, table_answers, tabled
from ..jit import copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..scene import Boats, Scene
from ..work import Work
from .paths import Manoeuvre, Span, trace_path
from .rank import OBSTACLES, Rank, better, level_to_beat

NO_PURSUERS, PURSUERS_TILL_READY, PURSUERS = range(3)
"""How far pursuers are run through: not at all, until tables answer (thrust is back, and of several for a while), or to
the end of the pursuit."""

CLEARLY_M = 1e-6
"""Margins this much below a bound are below it whatever the rounding, m: more than the room in which a table's value
counts as its cap."""


@lean_kernel
def pursuers_run(i: int, slot: int, boats: Boats, work: Work) -> int:
    """How far opponents near boat i are to be run through as pursuers, which takes a longer path."""
    if not work.pursued[i] or boats.table_steps[i] == 0:
        return PURSUERS if work.pursued[i] else NO_PURSUERS
    how = PURSUERS_TILL_READY if work.outnumbered[i] else NO_PURSUERS
    for j in range(work.near.shape[0]):
        if j == i or not work.near[i, j] or boats.team[i] == boats.team[j] or not may_pursue(j, boats, work):
            continue
        if not tabled(i, j, boats, work):
            return PURSUERS
        if not table_answers(i, j, slot, boats, work):
            how = PURSUERS_TILL_READY
    return how


@lean_kernel
def set_out(i: int, slot: int, side: float, togo_deg: float, speed_mps: float, done: int, scene: Scene) -> None:
    """Write a manoeuvre of boat i into ``slot`` and where its opponents are looked up for it."""
    work = scene.work
    work.plan[slot, 0], work.plan[slot, 1], work.plan[slot, 2] = side, togo_deg, speed_mps
    work.pursuers_known[slot] = False
    set_place(i, slot, side, togo_deg, speed_mps, done, scene)


@lean_kernel
def refused_by_tables(i: int, slot: int, best: Rank, scene: Scene) -> bool:
    """Whether by the tables alone the rank of the manoeuvre in ``slot`` cannot exceed ``best``: no path is needed.

    It cannot when a margin is short of its target and the least of them is no better than the best manoeuvre's. Who
    refused the last one is asked first, and nobody after the answer is clear.
    """
    ours, boats, work = scene.ours, scene.boats, scene.work
    if best.kept < OBSTACLES:
        return False
    first, least, fails = work.first_refuser[i], FAR, False
    for number in range(ours.shape[0]):
        j = first_then_rest(first, number)
        if j == i or ours[j] or not work.near[i, j] or not table_answers(i, j, slot, boats, work):
            continue
        enough_m = min(work.threat_target_m[i, j], level_to_beat(best)) - CLEARLY_M
        margin = margin_at_once(i, j, slot, enough_m, boats, work)
        least = min(least, margin)
        fails = fails or margin < work.threat_target_m[i, j]
        if fails and not better(Rank(OBSTACLES, least), best):
            work.first_refuser[i] = j
            return True
    return False


@lean_kernel
def lay_command(i: int, slot: int, scene: Scene) -> None:
    """Write where boat i is during the step it is predicted for, as far as that is of several moves."""
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    if tuning.moves == 1:
        return
    copy_row(work.row, state[i])
    for move in range(tuning.moves):
        step_boat(boats.params[i], work.row, work.command[i, 0], work.command[i, 1], tuning.model_s)
        if move % boats.stride == 0:
            path = work.path[slot, move // boats.stride]
            path[0], path[1] = work.row[L.X], work.row[L.Y]


@lean_kernel
def run_out(i: int, slot: int, done: int, scene: Scene) -> None:
    """Trace the manoeuvre in ``slot`` of boat i, from its predicted state (done = 1) or its present one (0)."""
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    how = pursuers_run(i, slot, boats, work)
    samples = boats.samples[i]
    if how != NO_PURSUERS:
        samples = boats.pursuit_samples[i] + boats.thrust_samples[i] + boats.chased_samples[i]
    earliest = 0 if done == 1 else (boats.table_steps[i] + boats.stride - 1) // boats.stride
    if work.outnumbered[i]:
        earliest = max(earliest, boats.joint_samples)
    earliest = min(earliest, samples)
    beyond = boats.pursuit_samples[i] + boats.chased_samples[i] if how == PURSUERS else 0
    manoeuvre = Manoeuvre(work.plan[slot, 0], work.plan[slot, 1], work.plan[slot, 2])
    moves = 0
    if done == 1:
        moves = tuning.moves
        lay_command(i, slot, scene)
    copy_row(work.row, work.next_state[i] if done == 1 else state[i])
    span = Span(
        tuning.model_s,
        moves,
        boats.stride,
        samples,
        boats.samples[i],
        beyond,
        earliest,
        boats.ready_thrust[i],
    )
    trace_path(boats.params[i], work.row, manoeuvre, span, work.path[slot], work.ready[slot])


@lean_kernel
def lay_path(i: int, slot: int, side: float, togo_deg: float, speed_mps: float, done: int, scene: Scene) -> None:
    """Trace a manoeuvre of boat i into ``slot``, from its predicted state (done = 1) or its present one (0)."""
    set_out(i, slot, side, togo_deg, speed_mps, done, scene)
    run_out(i, slot, done, scene)
