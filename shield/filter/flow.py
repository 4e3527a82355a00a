"""One decision, in compiled stages: screen; group by group back up, solve for a least change, ease; commit.

`decide_scene` chains them, with the compiled projection between. With a QP backend `deciders.Deciders` calls the same
stages.
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.assign import hold
from ..backup.effort import all_spent
from ..backup.rank import ALL, OBSTACLES, OPPONENTS
from ..barriers.clearance import MARGIN
from ..barriers.registered import unknown_at
from ..barriers.static import STATIC, about
from ..jit import copy_row, lean_kernel
from ..liveness.right_of_way import forget_pressing, note_pressing
from ..plan import BACKUP, BEST_EFFORT, HELD, QP, unchanged
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..scene import Scene
from .easing import any_may_be_eased, ease
from .groups import close_groups, make_groups, open_group
from .last_line import keep_last_line
from .least_change import ROUNDS, accept, among_mates, begin_program, end_program, linearise
from .linearised import solve_compiled
from .screening import screen
from .switching import back_up
from .verified import verify

ROUNDING_S = 1e-9
"""Times this short are none: what is left of a sum of steps."""

LEAST_TURN_DEG = 1e-3
"""Turns to go below this are made: what is remembered must not hang on the last bit of a heading."""


@lean_kernel
def _note_backing_up(i: int, scene: Scene) -> None:
    """Note whether boat i is on its backup, and for how long it stays so at least.

    On the bound of what it must keep a boat would else take up the wanted command and its backup in turn, from step to
    step, and one that turns at once would do so from side to side.
    """
    memory, reason = scene.memory, scene.plan.reason[i]
    backing_up = reason in (BACKUP, BEST_EFFORT)
    left_s = 0.0
    if backing_up:
        left_s = (memory.dwell_s[i] if memory.backing_up[i] else scene.boats.dwell_s[i]) - scene.tuning.dt_s
    memory.dwell_s[i] = left_s if left_s > ROUNDING_S else 0.0
    memory.backing_up[i] = backing_up


@lean_kernel
def commit(scene: Scene) -> None:
    """Keep every boat's manoeuvre for the next decision, as an absolute heading, and its margins.

    Values that tables tell of opponents are each a barrier of its own, and boats with tables keep them apart. Margins
    of a manoeuvre are not: another may trade one for the other, so for other boats the least counts for all.
    """
    ours, boats, memory, work = scene.ours, scene.boats, scene.memory, scene.work
    for i in range(ours.shape[0]):
        if not ours[i]:
            memory.has_backup[i] = False
            memory.backing_up[i] = False
            forget_pressing(i, memory)
            continue
        memory.has_backup[i] = True
        memory.side[i] = work.plan[i, 0]
        memory.target_deg[i] = np.nan
        if work.plan[i, 1] > LEAST_TURN_DEG:
            memory.target_deg[i] = wrap_degrees(
                work.next_state[i, L.HEADING] + math.copysign(work.plan[i, 1], work.plan[i, 0])
            )
        memory.speed_mps[i] = work.plan[i, 2]
        memory.margin_m[i] = work.clear[i, MARGIN]
        memory.static_m[i] = work.static[i, MARGIN] if work.kept[i] >= OPPONENTS else 0.0
        memory.joint_m[i] = work.joint_m[i] if work.outnumbered[i] else 0.0
        if boats.table_steps[i] > 0:
            copy_row(memory.threat_m[i], work.threats_m[i])
        else:
            memory.threat_m[i, :] = work.threat_m[i]
        _note_backing_up(i, scene)
        note_pressing(i, scene)


@lean_kernel
def _note_causes(scene: Scene) -> None:
    """Note what each boat's wanted command is short of: of an opponent also where a team-mate is nearer."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        plan.cause[i] = work.bound[i] if ours[i] and work.kept[i] < ALL else -1
        threatened = work.kept[i] == OBSTACLES and work.fails[i]
        if ours[i] and threatened and work.threat_by[i] >= 0:
            plan.cause[i] = work.threat_by[i]


@lean_kernel
def _name_static(scene: Scene) -> None:
    """Say of a command that was changed for static constraints, and keeps them now, that these bind and no boat.

    So does a barrier of a boat that is to stop since it tells nothing where that is.
    """
    ours, work, plan = scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        if ours[i] and plan.reason[i] == HELD and unknown_at(i, scene) >= 0:
            work.bound[i] = about(unknown_at(i, scene))
        if ours[i] and plan.cause[i] <= STATIC and work.kept[i] == ALL and not unchanged(i, plan):
            work.bound[i] = plan.cause[i]


@lean_kernel
def _name_unchanged(scene: Scene) -> None:
    """Say of wanted commands that come out as they were that they passed."""
    ours, plan = scene.ours, scene.plan
    for i in range(ours.shape[0]):
        settled = plan.reason[i] == QP or (plan.reason[i] == BACKUP and plan.slack_m[i] == 0.0)
        if ours[i] and settled and unchanged(i, plan):
            plan.reason[i] = plan.screened_reason[i]


@lean_kernel
def end(scene: Scene) -> None:
    """Say what binds and why, and remember what was decided."""
    close_groups(scene)
    keep_last_line(scene)
    commit(scene)
    _name_unchanged(scene)
    _name_static(scene)


@lean_kernel
def groups_left(scene: Scene) -> int:
    """Note what wanted commands are short of and the manoeuvres found for them; returns how many groups are left."""
    _note_causes(scene)
    for i in range(scene.ours.shape[0]):
        if scene.ours[i]:
            hold(i, scene.plan.held, scene.work)
    return make_groups(scene)


@lean_kernel
def begin(scene: Scene) -> int:
    """Screen the wanted commands; returns how many groups of boats they are not sent to as they are."""
    screen(scene)
    return groups_left(scene)


@lean_kernel
def begin_group(group: int, scene: Scene) -> int:
    """Make backups the commands of a group, and set up its program; returns how many boats take part in that."""
    open_group(group, scene)
    back_up(scene)
    if all_spent(scene.tuning, scene.work) or not any_may_be_eased(scene):
        return 0
    verify(among_mates(scene), scene)
    return begin_program(scene)


@lean_kernel
def end_group(scene: Scene, safe: bool, count: int) -> None:
    """End the program of so many boats, and ease the other backups."""
    end_program(scene, safe, count)
    ease(scene)


@lean_kernel
def decide_scene(scene: Scene) -> None:
    """The whole decision; sent commands are in ``plan.commands``, reasons in ``plan.reason``."""
    for group in range(begin(scene)):
        count, safe = begin_group(group, scene), False
        for _ in range(ROUNDS if count > 0 else 0):
            rows = linearise(count, scene)
            if rows < 0 or not solve_compiled(count, rows, scene.plan):
                break
            safe = accept(scene, scene.plan.z, count)
            if safe:
                break
        end_group(scene, safe, count)
    end(scene)
