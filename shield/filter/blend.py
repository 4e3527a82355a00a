"""What the backups come to, verified by the full model, and what an answer may cost of that.

Backups are a joint plan, see `backup_switch`. From it on what is nearer to the nominal commands is taken, an answer of
the program or a part of a backup, if no boat then keeps less than after its backup. Who uses up its margin to give way
as little as may be gives way for longer.
"""

from __future__ import annotations

from ..backup.assign import rate
from ..backup.rank import ALL, SAME_M
from ..jit import copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn
from ..platforms.usv import wrap_degrees
from ..workspace import BACKUP, BY_LINE_SEARCH, Scene, all_spent
from .nominal import check, set_required_margins

TURN, SPEED, HEADING, SATISFIED, SCORE = range(5)
"""Columns of ``scene.verified``."""

LITTLE_M = 0.001
"""What an answer of the program may cost a boat in a step, m: its rows are linear, and hardly one costs nothing."""


@lean_kernel
def note_verified(scene: Scene) -> None:
    """Note the commands that have just been checked, and the rank of each boat's backup after them."""
    state, ours = scene.state, scene.ours
    for i in range(ours.shape[0]):
        if ours[i]:
            scene.verified[i, TURN] = wrap_degrees(scene.next_state[i, L.HEADING] - state[i, L.HEADING])
            scene.verified[i, SPEED], scene.verified[i, HEADING] = scene.command[i, 0], scene.command[i, 1]
            scene.verified[i, SATISFIED], scene.verified[i, SCORE] = scene.satisfied[i], scene.score_m[i]


@lean_kernel
def verify(static_rate: bool, scene: Scene) -> None:
    """Rate what has been checked by what must be kept when commands are screened, and note it.

    Without ``static_rate`` of static constraints only their distance is asked for.
    """
    set_required_margins(scene)
    if not static_rate:
        scene.static_target_m[:] = 0.0
    rate(scene)
    note_verified(scene)


@lean_kernel
def satisfies_all(i: int, scene: Scene) -> bool:
    """Whether boat i's backup keeps everything."""
    return int(scene.verified[i, SATISFIED]) == ALL


@lean_kernel
def before_opponent(i: int, scene: Scene) -> bool:
    """Whether an opponent is in the way of what boat i wants."""
    cause = scene.violated[i]
    return cause >= 0 and not scene.ours[cause]


@lean_kernel
def restore_verified(i: int, scene: Scene) -> None:
    """Make boat i's command the verified one again."""
    scene.command[i, 0], scene.command[i, 1] = scene.verified[i, SPEED], scene.verified[i, HEADING]


@lean_kernel
def costs_at_most(most_m: float, scene: Scene) -> bool:
    """Whether no boat keeps less after the commands just checked, or, of those that keep everything, less by that."""
    ours, verified = scene.ours, scene.verified
    within = True
    for i in range(ours.shape[0]):
        if ours[i]:
            had = int(verified[i, SATISFIED])
            least_m = verified[i, SCORE] - SAME_M - (most_m if had == ALL else 0.0)
            within = within and (
                scene.satisfied[i] > had or (scene.satisfied[i] == had and scene.score_m[i] >= least_m)
            )
    return within


TRIALS = 3
"""Looks for the least share of a backup, the first at none of it: to a quarter of the way."""


@lean_kernel
def _mildest_turn(i: int, scene: Scene) -> float:
    """Turn, deg: the wanted one where it is a part of the backup's, straight on where it goes against it.

    As much against it as is allowed in this step would have to be taken back in the next.
    """
    wanted, backup = scene.checked_turn[i], scene.verified[i, TURN]
    if wanted * backup <= 0.0:
        return 0.0
    return wanted if abs(wanted) < abs(backup) else backup


@lean_kernel
def _give_back(share: float, i: int, scene: Scene) -> None:
    """Command of boat i that share of the way from its backup to the wanted one; all of it is that, bit for bit."""
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    backup, mildest = scene.verified[i], _mildest_turn(i, scene)
    if share == 1.0 and mildest == scene.checked_turn[i]:
        copy_row(scene.command[i], scene.checked[i])
        return
    turn = backup[TURN] + share * (mildest - backup[TURN])
    speed = backup[SPEED] + share * (scene.checked[i, 0] - backup[SPEED])
    speed = max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
    scene.command[i, 0] = speed
    scene.command[i, 1] = command_for_turn(boats.params[i], state[i], speed, turn, tuning.dt_s)


@lean_kernel
def _blend_one(i: int, scene: Scene) -> None:
    """Bring boat i's command as near to the wanted one as costs no boat of ours anything."""
    kept, too_far, at = 0.0, 2.0, 0.0
    scene.solver[i] = BY_LINE_SEARCH
    scene.moving[:] = False
    scene.moving[i] = True
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
        restore_verified(i, scene)
        scene.solver[i] = 0
    elif at != kept:
        _give_back(kept, i, scene)
    if at != kept:
        check(scene)


@lean_kernel
def _may_be_blended(i: int, scene: Scene) -> bool:
    """Whether boat i backs up before no opponent: of these too little is known, see `backup_switch`."""
    return scene.ours[i] and scene.reason[i] == BACKUP and not before_opponent(i, scene)


@lean_kernel
def any_may_be_blended(scene: Scene) -> bool:
    """Whether some boat may be."""
    found = False
    for i in range(scene.ours.shape[0]):
        found = found or _may_be_blended(i, scene)
    return found


@lean_kernel
def blend(scene: Scene) -> None:
    """Take back of backups, boat by boat, what is not needed to keep what they keep.

    Margins from boats are those that have to be kept, as when the nominal commands were screened; backups that do not
    keep them are carried out as they are. Of static constraints only their distance is asked for, but of boats between
    these and teammates: who uses up its room there has none left to make for others.
    """
    for i in range(scene.ours.shape[0]):
        if _may_be_blended(i, scene) and satisfies_all(i, scene) and not all_spent(scene):
            _blend_one(i, scene)
