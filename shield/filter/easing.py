"""Between a backup and the wanted commands: no more of the backup than it takes.

Along an edge or a wall what is left of the distance to it falls with the square of the angle towards it. The rows of
the program, which are linear, then find no answer, and a boat that wants through would steer full rudder out and in.
"""

from __future__ import annotations

from ..backup.effort import all_spent
from ..jit import copy_row, lean_kernel
from ..plan import BACKUP, Plan
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn
from ..scene import Scene
from .exact_check import check
from .verified import SPEED, TURN, before_opponent, costs_at_most, go_back, keeps_all

TRIALS = 3
"""Looks for the least share of a backup, the first at none of it: to a quarter of the way."""


@lean_kernel
def _mildest_turn(i: int, plan: Plan) -> float:
    """Turn, deg: the wanted one where it is a part of the backup's, straight on where it goes against it.

    As much against it as is allowed in this step would have to be taken back in the next.
    """
    wanted, backup = plan.wanted_turn[i], plan.verified[i, TURN]
    if wanted * backup <= 0.0:
        return 0.0
    return wanted if abs(wanted) < abs(backup) else backup


@lean_kernel
def _give_back(share: float, i: int, scene: Scene) -> None:
    """Command of boat i that share of the way from its backup to the wanted one; all of it is that, bit for bit."""
    state, boats, tuning, plan = scene.state, scene.boats, scene.tuning, scene.plan
    backup, mildest = plan.verified[i], _mildest_turn(i, plan)
    if share == 1.0 and mildest == plan.wanted_turn[i]:
        copy_row(plan.commands[i], plan.screened[i])
        return
    turn = backup[TURN] + share * (mildest - backup[TURN])
    speed = backup[SPEED] + share * (plan.screened[i, 0] - backup[SPEED])
    speed = max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
    plan.commands[i, 0] = speed
    plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, turn, tuning.dt_s)


@lean_kernel
def _ease_one(i: int, scene: Scene) -> None:
    """Bring boat i's command as near to the wanted one as costs no boat of ours anything."""
    kept, too_far, at = 0.0, 2.0, 0.0
    scene.plan.moving[:] = False
    scene.plan.moving[i] = True
    for _ in range(TRIALS):
        at = 0.5 * (kept + too_far)
        _give_back(at, i, scene)
        check(scene)
        if costs_at_most(0.0, scene):
            kept = at
        else:
            too_far = at
        if kept == 1.0:
            break
    if kept == 0.0:
        go_back(i, scene)
    elif at != kept:
        _give_back(kept, i, scene)
    if at != kept:
        check(scene)


@lean_kernel
def _may_be_eased(i: int, scene: Scene) -> bool:
    """Whether boat i backs up before no opponent: of these too little is known, see `switching`."""
    return scene.ours[i] and scene.plan.reason[i] == BACKUP and not before_opponent(i, scene)


@lean_kernel
def any_may_be_eased(scene: Scene) -> bool:
    """Whether some boat may be."""
    found = False
    for i in range(scene.ours.shape[0]):
        found = found or _may_be_eased(i, scene)
    return found


@lean_kernel
def ease(scene: Scene) -> None:
    """Take back of backups, boat by boat, what is not needed to keep what they keep.

    Margins from boats are those that have to be kept, as when the wanted commands were screened; backups that do not
    keep them are carried out as they are. Of static constraints only their distance is asked for, but of boats between
    these and team-mates: who uses up its room there has none left to make for others.
    """
    tuning, work = scene.tuning, scene.work
    for i in range(scene.ours.shape[0]):
        if _may_be_eased(i, scene) and keeps_all(i, scene) and not all_spent(tuning, work):
            _ease_one(i, scene)
