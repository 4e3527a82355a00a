"""The exact check of candidate commands: by the full model one step on, and the backups from there."""

from __future__ import annotations

from ..backup.assign import recheck, recheck_one
from ..jit import lean_kernel
from ..scene import Scene
from .screening import predict


@lean_kernel
def check(count: int, scene: Scene) -> None:
    """Predict the movers, and rate what each boat then keeps on the manoeuvre in ``plan.held``."""
    plan = scene.plan
    for m in range(count):
        predict(plan.movers[m], plan.commands, scene)
    recheck(scene)


@lean_kernel
def check_one(i: int, scene: Scene) -> None:
    """The same where nothing but the command of boat i has changed since."""
    predict(i, scene.plan.commands, scene)
    recheck_one(i, scene)
