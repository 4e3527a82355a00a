"""The program between team-mates: of the commands that cost no boat what its backup keeps, those nearest to the wanted.

Least changes are for those who decide with us, and of whom nothing else is in the way; see `switching`.
"""

from __future__ import annotations

from ..backup.effort import all_spent
from ..backup.rank import ALL
from ..jit import Array, copy_row, lean_kernel
from ..plan import QP, unchanged
from ..scene import Scene
from .linearised import build, check, list_movers, take_answer
from .screening import set_targets
from .verified import LITTLE_M, costs_at_most, go_back, note_verified

ROUNDS = 2
"""Times the program is linearised and solved anew before the backups stand."""


@lean_kernel
def _yields(i: int, scene: Scene) -> bool:
    """Whether boat i's backup keeps everything, and no opponent is in the way of its wanted command."""
    cause = scene.plan.cause[i]
    return scene.ours[i] and scene.work.kept[i] == ALL and (cause < 0 or scene.ours[cause])


@lean_kernel
def _pick_pairs(scene: Scene) -> int:
    """Make movers of the boats that team-mates are in the way of, and of these; returns how many they are."""
    ours, plan = scene.ours, scene.plan
    plan.moving[:] = False
    for i in range(ours.shape[0]):
        j = plan.cause[i]
        if j >= 0 and ours[j] and _yields(i, scene):
            plan.moving[i] = True
            plan.moving[j] = plan.moving[j] or _yields(j, scene)
    return list_movers(plan)


@lean_kernel
def _among_mates(scene: Scene) -> bool:
    """Whether team-mates are in the way of any wanted command."""
    ours, plan = scene.ours, scene.plan
    found = False
    for i in range(ours.shape[0]):
        found = found or (ours[i] and plan.cause[i] >= 0 and ours[plan.cause[i]])
    return found


@lean_kernel
def begin_program(scene: Scene) -> int:
    """Note the backups, and make wanted commands of the boats that take part the candidate; returns how many do."""
    plan = scene.plan
    if not _among_mates(scene):
        return 0
    set_targets(scene)
    check(list_movers(plan), scene)
    note_verified(scene)
    count = _pick_pairs(scene)
    for m in range(count):
        copy_row(plan.commands[plan.movers[m]], plan.screened[plan.movers[m]])
    check(count, scene)
    return count


@lean_kernel
def linearise(count: int, scene: Scene) -> int:
    """Rows about the candidate; how many, or -1 when there are too many or the decision has cost its limit."""
    return -1 if all_spent(scene.tuning, scene.work) else build(count, scene)


@lean_kernel
def accept(scene: Scene, z: Array, count: int) -> bool:
    """Take an answer of the program; whether it costs nothing by the exact check."""
    if not take_answer(z, count, scene):
        return False
    check(count, scene)
    return costs_at_most(LITTLE_M, scene)


@lean_kernel
def end_program(scene: Scene, safe: bool, count: int) -> None:
    """Name the reasons of an answer that was accepted, or take the backups back up."""
    plan = scene.plan
    for m in range(count):
        i = plan.movers[m]
        if safe:
            plan.slack_m[i] = 0.0
            plan.reason[i] = plan.screened_reason[i] if unchanged(i, plan) else QP
        else:
            go_back(i, scene)
    if count > 0 and not safe:
        check(count, scene)
