"""The first stage of a decision: whether the wanted commands can be sent as they are."""

from __future__ import annotations

from ..backup.assign import assign_plans
from ..barriers.clearance import FAR
from ..barriers.neighbours import find_neighbours
from ..barriers.registered import unknown_at
from ..barriers.static import beyond_line
from ..jit import copy_row, lean_kernel
from ..liveness.right_of_way import apply_right_of_way
from ..plan import HELD, LARGEST_COMMAND, NOT_COVERED, PASSED, STOPPED
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..scene import Boats, Scene
from ..tables.grid import CAP
from ..work import Work
from .exact_check import predict


@lean_kernel
def _most_known(i: int, j: int, boats: Boats, work: Work) -> float:
    """Largest margin, m, a table can tell of a pair: beyond it the margin is said to be infinite."""
    table = boats.table[i, j]
    if table < 0:
        return FAR
    return boats.tables.axes[table, CAP] - work.radius[i, j] - boats.table_margin_m


@lean_kernel
def _asked(decay: float, was_m: float, cap_m: float) -> float:
    """Margin, m, that is asked for of one that was ``was_m``, capped: the class-K rate of a step, but never below 0."""
    return decay * max(0.0, min(was_m, cap_m))


@lean_kernel
def set_targets(scene: Scene) -> None:
    """Margins each boat must keep: the discrete-time class-K condition h(x+) >= decay * min(h(x), cap), at least 0.

    What is feared of opponents has its own, of each: beside a team-mate, whose margin is small and sure, it would else
    be let go at once. That from team-mates of ours shrinks freely until it is small: what they will do is known.

    A boat that dwells on its backup gives nothing of it away: all there may be is asked for.
    """
    ours, boats, tuning, memory, work = scene.ours, scene.boats, scene.tuning, scene.memory, scene.work
    for i in range(ours.shape[0]):
        work.target[i] = 0.0
        work.mate_target_m[i] = 0.0
        work.threat_target_m[i, :] = 0.0
        work.joint_target_m[i] = 0.0
        work.static_target_m[i] = 0.0
        if ours[i] and memory.has_backup[i]:
            decay, cap_m = boats.decay[i], boats.cap_m[i]
            work.target[i] = _asked(decay, memory.margin_m[i], cap_m)
            work.mate_target_m[i] = _asked(decay, memory.margin_m[i], min(tuning.mate_cap_m, cap_m))
            work.joint_target_m[i] = _asked(boats.joint_decay, memory.joint_m[i], cap_m)
            work.static_target_m[i] = _asked(tuning.static_decay, memory.static_m[i], tuning.margin_cap_m)
            for j in range(ours.shape[0]):
                most_m = min(cap_m, _most_known(i, j, boats, work))
                kept_m = _asked(decay, memory.threat_m[i, j], most_m)
                work.threat_target_m[i, j] = most_m if memory.dwell_s[i] > 0.0 else kept_m


@lean_kernel
def screen(scene: Scene) -> bool:
    """Check the wanted commands as they are; True when every boat still has its backup after them.

    An unusable command (NaN, infinite or beyond `LARGEST_COMMAND`), or one of a boat of whose place a registered
    barrier tells nothing, is replaced by holding course at zero speed before the check.
    """
    state, ours, work, plan = scene.state, scene.ours, scene.work, scene.plan
    n, wanted = state.shape[0], work.wanted
    find_neighbours(scene)
    set_targets(scene)
    for i in range(n):
        copy_row(plan.commands[i], wanted[i])
        plan.slack_m[i] = 0.0
        plan.moving[i] = False
        plan.reason[i] = PASSED if ours[i] else NOT_COVERED
        if not ours[i]:
            continue
        usable = abs(wanted[i, 0]) <= LARGEST_COMMAND and abs(wanted[i, 1]) <= LARGEST_COMMAND
        if not usable or unknown_at(i, scene) >= 0:
            plan.commands[i, 0], plan.commands[i, 1] = 0.0, 0.0
            plan.reason[i] = HELD
        if beyond_line(i, scene):
            plan.commands[i, 0], plan.commands[i, 1], plan.reason[i] = 0.0, 0.0, STOPPED
            predict(i, plan.commands, scene)
            continue
        apply_right_of_way(i, scene)
        predict(i, plan.commands, scene)
        plan.wanted_turn[i] = wrap_degrees(work.next_state[i, L.HEADING] - state[i, L.HEADING])
    for i in range(n):
        copy_row(plan.screened[i], plan.commands[i])
        plan.screened_reason[i] = plan.reason[i]
    return assign_plans(scene, 1, ours)
