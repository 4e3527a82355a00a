"""Between a backup and the wanted commands: no more of the backup than static constraints ask for.

Along an edge or a wall what is left of the distance to it falls with the square of the angle towards it. The rows of
the program, which are linear, then find no answer, and a boat that wants through would steer full rudder out and in.
"""

from __future__ import annotations

from ..backup.effort import all_spent
from ..backup.rank import ALL, Rank, better, rank_of
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

TURN, SPEED, HEADING, KEPT, WORTH = range(5)
"""Columns of ``Plan.verified``."""


@lean_kernel
def note_verified(scene: Scene) -> None:
    """Note the commands that have just been checked, and the ranks of the backups after them."""
    state, ours, work, plan = scene.state, scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        if ours[i]:
            plan.verified[i, TURN] = wrap_degrees(work.next_state[i, L.HEADING] - state[i, L.HEADING])
            plan.verified[i, SPEED], plan.verified[i, HEADING] = plan.commands[i, 0], plan.commands[i, 1]
            plan.verified[i, KEPT], plan.verified[i, WORTH] = work.kept[i], work.worth_m[i]


@lean_kernel
def no_worse(scene: Scene) -> bool:
    """Whether no boat of ours has less than after the commands noted."""
    ours, work, noted = scene.ours, scene.work, scene.plan.verified
    worse = False
    for i in range(ours.shape[0]):
        if ours[i]:
            worse = worse or better(Rank(int(noted[i, KEPT]), noted[i, WORTH]), rank_of(i, work))
    return not worse


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
def _go_back(share: float, i: int, scene: Scene) -> None:
    """Command of boat i that share of the way back from its backup."""
    state, boats, tuning, plan = scene.state, scene.boats, scene.tuning, scene.plan
    backup = plan.verified[i]
    turn = backup[TURN] + share * (_mildest_turn(i, plan) - backup[TURN])
    speed = backup[SPEED] + share * (plan.screened[i, 0] - backup[SPEED])
    speed = max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
    plan.commands[i, 0] = speed
    plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, turn, tuning.dt_s)


@lean_kernel
def _ease_one(i: int, count: int, scene: Scene) -> None:
    """Bring boat i's command as near to the wanted one as is no worse for any boat of ours."""
    plan = scene.plan
    kept, too_far, at = 0.0, 2.0, 0.0
    for _ in range(TRIALS):
        at = 0.5 * (kept + too_far)
        _go_back(at, i, scene)
        check(count, scene)
        if no_worse(scene):
            kept = at
        else:
            too_far = at
        if kept == 1.0:
            return
    if at == kept:
        return
    _go_back(kept, i, scene)
    if kept == 0.0:
        plan.commands[i, 0], plan.commands[i, 1] = plan.verified[i, SPEED], plan.verified[i, HEADING]
    check(count, scene)


@lean_kernel
def ease(count: int, scene: Scene) -> None:
    """Take back of backups, boat by boat, what is not needed to keep what they keep.

    Of boats that static constraints alone are in the way of, or nothing but their team-mates' backups. Margins from
    boats are those that have to be kept, as when the wanted commands were screened; of static constraints only their
    distance is asked for.
    """
    tuning, work, plan = scene.tuning, scene.work, scene.plan
    set_targets(scene)
    work.static_target_m[:] = 0.0
    check(count, scene)
    note_verified(scene)
    for m in range(count):
        if all_spent(tuning, work):
            return
        i = plan.movers[m]
        if plan.cause[i] < 0 and int(plan.verified[i, KEPT]) == ALL:
            _ease_one(i, count, scene)
