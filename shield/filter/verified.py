"""What the backups come to, verified by the full model: nothing else is sent that has less.

Backups are a joint plan for all boats of ours, see `switching`. From it on whatever is nearer to the wanted commands is
taken, an answer of the program or a part of a backup, that costs no boat of ours anything of what it then keeps. Who
uses up its margin to give way as little as may be gives way for longer.
"""

from __future__ import annotations

from ..backup.rank import Rank, better, rank_of
from ..jit import lean_kernel
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..scene import Scene

TURN, SPEED, HEADING, KEPT, WORTH = range(5)
"""Columns of ``Plan.verified``."""

LITTLE_M = 0.005
"""What an answer of the program may cost a boat in a step, m: its rows are linear, and none costs nothing at all."""


@lean_kernel
def note_verified(scene: Scene) -> None:
    """Note the commands that have just been checked, and the rank of each boat's backup after them."""
    state, ours, work, plan = scene.state, scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        if ours[i]:
            plan.verified[i, TURN] = wrap_degrees(work.next_state[i, L.HEADING] - state[i, L.HEADING])
            plan.verified[i, SPEED], plan.verified[i, HEADING] = plan.commands[i, 0], plan.commands[i, 1]
            plan.verified[i, KEPT], plan.verified[i, WORTH] = work.kept[i], work.worth_m[i]


@lean_kernel
def go_back(i: int, scene: Scene) -> None:
    """Make boat i's command the verified one again."""
    plan = scene.plan
    plan.commands[i, 0], plan.commands[i, 1] = plan.verified[i, SPEED], plan.verified[i, HEADING]


@lean_kernel
def costs_at_most(most_m: float, scene: Scene) -> bool:
    """Whether no boat of ours keeps less by more than that after the commands just checked than after the verified."""
    ours, work, verified = scene.ours, scene.work, scene.plan.verified
    within = True
    for i in range(ours.shape[0]):
        if ours[i]:
            had = Rank(int(verified[i, KEPT]), verified[i, WORTH] - most_m)
            within = within and not better(had, rank_of(i, work))
    return within
