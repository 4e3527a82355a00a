"""The exact check of candidate commands: by the full model one step on, and the backups from there."""

from __future__ import annotations

from ..backup.assign import recheck
from ..jit import lean_kernel
from ..scene import Scene
from .screening import predict


@lean_kernel
def check(scene: Scene) -> None:
    """Predict the movers, and rate what each boat then keeps on the manoeuvre in ``plan.held``."""
    for i in range(scene.ours.shape[0]):
        if scene.plan.moving[i]:
            predict(i, scene.plan.commands, scene)
    recheck(scene)
