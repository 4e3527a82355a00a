"""The program between team-mates: nearest to the wanted commands of those that leave every boat what its backup keeps.

Least changes are for those who decide with us, and whom no opponent is in the way of; see `switching`.
"""

from __future__ import annotations

from ..backup.effort import all_spent
from ..jit import Array, copy_row, lean_kernel
from ..plan import QP
from ..scene import Scene
from .exact_check import check
from .linearised import build, take_answer
from .switching import list_movers
from .verified import LITTLE_M, before_opponent, costs_at_most, go_back, keeps_all, note_verified

ROUNDS = 2
"""Times the program is linearised and solved anew before the backups stand."""


@lean_kernel
def _pick_pairs(scene: Scene) -> int:
    """Make movers of the boats that team-mates are in the way of, and of these; returns how many they are.

    None that an opponent is in the way of, or whose backup is short of something: what these do is settled.
    """
    ours, plan = scene.ours, scene.plan
    plan.moving[:] = False
    for i in range(ours.shape[0]):
        j = plan.cause[i]
        if ours[i] and j >= 0 and ours[j] and keeps_all(i, scene):
            plan.moving[i] = True
            plan.moving[j] = plan.moving[j] or (keeps_all(j, scene) and not before_opponent(j, scene))
    return list_movers(plan)


@lean_kernel
def among_mates(scene: Scene) -> bool:
    """Whether team-mates are in the way of any wanted command."""
    ours, cause = scene.ours, scene.plan.cause
    found = False
    for i in range(ours.shape[0]):
        found = found or (ours[i] and cause[i] >= 0 and ours[cause[i]])
    return found


@lean_kernel
def begin_program(scene: Scene) -> int:
    """Make wanted commands of the boats that take part the candidate; returns how many do."""
    plan = scene.plan
    count = _pick_pairs(scene)
    for m in range(count):
        copy_row(plan.commands[plan.movers[m]], plan.screened[plan.movers[m]])
    if count > 0:
        check(scene)
    return count


@lean_kernel
def linearise(count: int, scene: Scene) -> int:
    """Rows about the candidate; how many, or -1 when there are too many or the decision has cost its limit."""
    return -1 if all_spent(scene.tuning, scene.work) else build(count, scene)


@lean_kernel
def accept(scene: Scene, z: Array, count: int) -> bool:
    """Take an answer of the program; whether it costs no boat more than a little by the exact check."""
    if not take_answer(z, count, scene):
        return False
    check(scene)
    return costs_at_most(LITTLE_M, scene)


@lean_kernel
def end_program(scene: Scene, safe: bool, count: int) -> None:
    """Name the reasons of an answer that was accepted, or take the backups back up."""
    plan = scene.plan
    for m in range(count):
        i = plan.movers[m]
        if safe:
            plan.slack_m[i] = 0.0
            plan.reason[i] = QP
        else:
            go_back(i, scene)
    if safe:
        note_verified(scene)
    elif count > 0:
        check(scene)
