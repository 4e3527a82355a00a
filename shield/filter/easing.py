"""Between a backup and the wanted commands: no more of the backup than static constraints ask for.

Along an edge or a wall what is left of the distance to it falls with the square of the angle towards it. The rows of
the program, which are linear, then find no answer, and a boat that wants through would steer full rudder out and in.
"""

from __future__ import annotations

from ..backup.effort import all_spent
from ..backup.rank import ALL, SAME_M, all_keep
from ..jit import lean_kernel
from ..plan import Plan
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn
from ..platforms.usv import wrap_degrees
from ..scene import Scene
from .linearised import check
from .screening import set_targets

TRIALS = 3
"""Looks for the least share of a backup, the first at none of it: to a quarter of the way."""


@lean_kernel
def _mildest_turn(i: int, plan: Plan) -> float:
    """Turn, deg: the wanted one where it is a part of the backup's, straight on where it goes against it.

    As much against it as is allowed in this step would have to be taken back in the next.
    """
    wanted, backup = plan.wanted_turn[i], plan.eased[i, 0]
    if wanted * backup <= 0.0:
        return 0.0
    return wanted if abs(wanted) < abs(backup) else backup


@lean_kernel
def _go_back(share: float, i: int, scene: Scene) -> None:
    """Command of boat i that share of the way back from its backup, ``plan.eased``."""
    state, boats, tuning, plan = scene.state, scene.boats, scene.tuning, scene.plan
    turn = plan.eased[i, 0] + share * (_mildest_turn(i, plan) - plan.eased[i, 0])
    speed = plan.eased[i, 1] + share * (plan.screened[i, 0] - plan.eased[i, 1])
    speed = max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
    plan.commands[i, 0] = speed
    plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, turn, tuning.dt_s)


@lean_kernel
def _no_worse(scene: Scene) -> bool:
    """Whether no boat of ours has less than with all backups."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    worse = not all_keep(ALL, ours, work)
    for i in range(ours.shape[0]):
        worse = worse or (ours[i] and not work.worth_m[i] >= plan.eased[i, 2] - SAME_M)
    return not worse


@lean_kernel
def _ease_one(i: int, count: int, scene: Scene) -> None:
    """Bring boat i's command as near to the wanted one as is no worse for any boat of ours."""
    plan = scene.plan
    speed, heading = plan.commands[i, 0], plan.commands[i, 1]
    kept, too_far, at = 0.0, 2.0, 0.0
    for _ in range(TRIALS):
        at = 0.5 * (kept + too_far)
        _go_back(at, i, scene)
        check(count, scene)
        if _no_worse(scene):
            kept = at
        else:
            too_far = at
        if kept == 1.0:
            return
    if at == kept:
        return
    _go_back(kept, i, scene)
    if kept == 0.0:
        plan.commands[i, 0], plan.commands[i, 1] = speed, heading
    check(count, scene)


@lean_kernel
def ease(count: int, scene: Scene) -> None:
    """Take back of the movers' backups, boat by boat, what is not needed to keep what they keep.

    Margins from boats are those that have to be kept, as when the wanted commands were screened; backups that do not
    keep them are carried out as they are. Of static constraints only their distance is asked for.
    """
    state, ours, tuning, work, plan = scene.state, scene.ours, scene.tuning, scene.work, scene.plan
    set_targets(scene)
    work.static_target_m[:] = 0.0
    check(count, scene)
    if not all_keep(ALL, ours, work):
        return
    for i in range(ours.shape[0]):
        plan.eased[i, 2] = work.worth_m[i]
    for m in range(count):
        if all_spent(tuning, work):
            return
        i = plan.movers[m]
        plan.eased[i, 0] = wrap_degrees(work.next_state[i, L.HEADING] - state[i, L.HEADING])
        plan.eased[i, 1] = plan.commands[i, 0]
        _ease_one(i, count, scene)
