"""What the backups come to, verified by the full model, and what an answer may cost of that.

Backups are a joint plan, see `switching`. From it on what is nearer to the wanted commands is taken, an answer of the
program or a part of a backup, if no boat then keeps less than after its backup. Who uses up its margin to give way as
little as may be gives way for longer.
"""

from __future__ import annotations

from ..backup.assign import rate
from ..backup.rank import ALL, SAME_M
from ..jit import lean_kernel
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..scene import Scene
from .screening import set_targets

TURN, SPEED, HEADING, KEPT, WORTH = range(5)
"""Columns of ``Plan.verified``."""

LITTLE_M = 0.001
"""What an answer of the program may cost a boat in a step, m: its rows are linear, and hardly one costs nothing."""


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
def verify(static_rate: bool, scene: Scene) -> None:
    """Rate what has been checked by what must be kept when commands are screened, and note it.

    Without ``static_rate`` of static constraints only their distance is asked for.
    """
    set_targets(scene)
    if not static_rate:
        scene.work.static_target_m[:] = 0.0
    rate(scene)
    note_verified(scene)


@lean_kernel
def keeps_all(i: int, scene: Scene) -> bool:
    """Whether boat i's backup keeps everything."""
    return int(scene.plan.verified[i, KEPT]) == ALL


@lean_kernel
def before_opponent(i: int, scene: Scene) -> bool:
    """Whether an opponent is in the way of what boat i wants."""
    cause = scene.plan.cause[i]
    return cause >= 0 and not scene.ours[cause]


@lean_kernel
def go_back(i: int, scene: Scene) -> None:
    """Make boat i's command the verified one again."""
    plan = scene.plan
    plan.commands[i, 0], plan.commands[i, 1] = plan.verified[i, SPEED], plan.verified[i, HEADING]


@lean_kernel
def costs_at_most(most_m: float, scene: Scene) -> bool:
    """Whether no boat keeps less after the commands just checked, or, of those that keep everything, less by that."""
    ours, work, verified = scene.ours, scene.work, scene.plan.verified
    within = True
    for i in range(ours.shape[0]):
        if ours[i]:
            had = int(verified[i, KEPT])
            least_m = verified[i, WORTH] - SAME_M - (most_m if had == ALL else 0.0)
            within = within and (work.kept[i] > had or (work.kept[i] == had and work.worth_m[i] >= least_m))
    return within
