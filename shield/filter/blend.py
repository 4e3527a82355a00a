"""The line search between backup and nominal command; every candidate is held against the verified backup's score.

Backups are a joint plan, see `backup_switch`. A command nearer to the nominal one, from the QP or from a blend, is
accepted only if no boat then scores below its verified backup. A boat that spent its margin on smaller changes would
have to give way for longer.
"""

from __future__ import annotations

from ..backup.assign import score_all
from ..backup.score import CLEAR_OF_ALL, SAME_M
from ..jit import copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn
from ..platforms.usv import wrap_degrees
from ..workspace import BACKUP, BY_LINE_SEARCH, Scene, all_spent
from .nominal import predict_and_score, set_required_margins

TURN, SPEED, HEADING, SATISFIED, SCORE = range(5)
"""Columns of ``scene.verified``."""

LITTLE_M = 0.001
"""Largest margin that an answer of the QP may cost a boat in a step, m: rows are linear, so it seldom costs nothing."""


@lean_kernel
def note_verified(scene: Scene) -> None:
    """Note the commands just checked, and each boat's score on its backup after them."""
    state, ours = scene.state, scene.ours
    for i in range(ours.shape[0]):
        if ours[i]:
            scene.verified[i, TURN] = wrap_degrees(scene.next_state[i, L.HEADING] - state[i, L.HEADING])
            scene.verified[i, SPEED], scene.verified[i, HEADING] = scene.command[i, 0], scene.command[i, 1]
            scene.verified[i, SATISFIED], scene.verified[i, SCORE] = scene.satisfied[i], scene.score_m[i]


@lean_kernel
def rescore_backups(static_rate: bool, scene: Scene) -> None:
    """Score the commands just checked against the required margins of the nominal check, and note the result.

    Without ``static_rate``, static constraints require only their distance, not their class-K rate.
    """
    set_required_margins(scene)
    if not static_rate:
        scene.static_target_m[:] = 0.0
    score_all(scene)
    note_verified(scene)


@lean_kernel
def satisfies_all(i: int, scene: Scene) -> bool:
    """Return whether boat i's backup satisfies all constraints."""
    return int(scene.verified[i, SATISFIED]) == CLEAR_OF_ALL


@lean_kernel
def before_opponent(i: int, scene: Scene) -> bool:
    """Return whether boat i's nominal command violates the margin from an opponent."""
    cause = scene.violated[i]
    return cause >= 0 and not scene.ours[cause]


@lean_kernel
def restore_verified(i: int, scene: Scene) -> None:
    """Make the verified command boat i's command again."""
    scene.command[i, 0], scene.command[i, 1] = scene.verified[i, SPEED], scene.verified[i, HEADING]


@lean_kernel
def keeps_backup_scores(most_m: float, scene: Scene) -> bool:
    """Return whether no boat scores below its verified backup, by more than ``most_m`` where all is satisfied."""
    ours, verified = scene.ours, scene.verified
    within = True
    for i in range(ours.shape[0]):
        if ours[i]:
            had = int(verified[i, SATISFIED])
            least_m = verified[i, SCORE] - SAME_M - (most_m if had == CLEAR_OF_ALL else 0.0)
            within = within and (
                scene.satisfied[i] > had or (scene.satisfied[i] == had and scene.score_m[i] >= least_m)
            )
    return within


TRIALS = 3
"""Trials of the line search; the first is the nominal command. They resolve a quarter of the way."""


@lean_kernel
def _mildest_turn(i: int, scene: Scene) -> float:
    """Return the turn nearest to the nominal one, deg: 0 where nominal turn and backup go to opposite sides.

    A turn against the backup would have to be undone in the next step. One of a boat that lies still costs nothing.
    """
    nominal, backup = scene.checked_turn[i], scene.verified[i, TURN]
    if backup == 0.0 and scene.next_state[i, L.SPEED] == 0.0:
        return nominal
    if nominal * backup <= 0.0:
        return 0.0
    return nominal if abs(nominal) < abs(backup) else backup


@lean_kernel
def _give_back(share: float, i: int, scene: Scene) -> None:
    """Blend boat i's command: ``share`` of the way from backup to nominal; all of it is the nominal command exactly."""
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
    """Move boat i's command as near to the nominal one as possible at no cost to any own boat's score."""
    kept, too_far, at = 0.0, 2.0, 0.0
    scene.solver[i] = BY_LINE_SEARCH
    scene.moving[:] = False
    scene.moving[i] = True
    for _ in range(TRIALS):
        at = 0.5 * (kept + too_far)
        _give_back(at, i, scene)
        predict_and_score(scene)
        if keeps_backup_scores(0.0, scene):
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
        predict_and_score(scene)


@lean_kernel
def _may_be_blended(i: int, scene: Scene) -> bool:
    """Return whether boat i is on a backup from something other than an opponent, see `backup_switch`."""
    return scene.ours[i] and scene.reason[i] == BACKUP and not before_opponent(i, scene)


@lean_kernel
def any_may_be_blended(scene: Scene) -> bool:
    """Return whether any boat may be blended."""
    found = False
    for i in range(scene.ours.shape[0]):
        found = found or _may_be_blended(i, scene)
    return found


@lean_kernel
def blend(scene: Scene) -> None:
    """Blend the backups, boat by boat, as far as every boat still satisfies what it satisfies on its backup.

    Required margins are those of the nominal check; a backup that does not satisfy them is sent whole. Static
    constraints require only their distance, except between such a constraint and a teammate: there a boat must keep
    room for others.
    """
    for i in range(scene.ours.shape[0]):
        if _may_be_blended(i, scene) and satisfies_all(i, scene) and not all_spent(scene):
            _blend_one(i, scene)
