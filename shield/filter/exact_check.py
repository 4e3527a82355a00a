"""The exact check of candidate commands: by the full model one step on, and the backups from there."""

from __future__ import annotations

from ..backup.assign import recheck
from ..jit import Array, copy_row, lean_kernel
from ..platforms.step import step_boat
from ..scene import Scene


@lean_kernel
def predict(i: int, commands: Array, scene: Scene) -> None:
    """State of boat i one step after its command, by the full boat and autopilot model."""
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    copy_row(work.next_state[i], state[i])
    copy_row(work.command[i], commands[i])
    step_boat(boats.params[i], work.next_state[i], commands[i, 0], commands[i, 1], tuning.dt_s)


@lean_kernel
def check(scene: Scene) -> None:
    """Predict the movers, and rate what each boat then keeps on the manoeuvre in ``plan.held``."""
    for i in range(scene.ours.shape[0]):
        if scene.plan.moving[i]:
            predict(i, scene.plan.commands, scene)
    recheck(scene)
