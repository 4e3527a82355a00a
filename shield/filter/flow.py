"""One decision, in compiled stages: screen, build rows, check an answer, back up, commit.

The single decision (`shield.Shield`) calls the stages from Python with a QP backend between them; `decide_compiled`
chains the same stages with the compiled projection for thousands of games. Nothing else differs between the two.
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.effort import all_spent
from ..backup.rank import PAIR_SAFE, STATIC_LOST
from ..barriers.clearance import MARGIN
from ..barriers.static import STATIC
from ..jit import Array, BoolArray, copy_row, lean_kernel
from ..liveness.right_of_way import forget_pressing, note_pressing
from ..plan import BACKUP, BEST_EFFORT, QP, unchanged
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..scene import Scene
from .linearised import build, check, pick_movers, solve_compiled, take_answer
from .screening import screen
from .switching import back_up, mark_answer, opposed

ROUNDS = 2
"""Times the program is linearised and solved anew before the backups take over."""

PASSES, TO_SOLVE, TO_BACK_UP = range(3)
"""What is left to do once the wanted commands are screened: nothing, the program, or the backups at once."""

NO_ANSWER, UNSAFE, SAFE = range(3)
"""What an answer of the program comes to: none that can be sent, one that fails the exact check, one that passes."""

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
            memory.kept[i] = False
            memory.backing_up[i] = False
            forget_pressing(i, memory)
            continue
        memory.kept[i] = True
        memory.side[i] = work.plan[i, 0]
        memory.target_deg[i] = np.nan
        if work.plan[i, 1] > LEAST_TURN_DEG:
            memory.target_deg[i] = wrap_degrees(
                work.next_state[i, L.HEADING] + math.copysign(work.plan[i, 1], work.plan[i, 0])
            )
        memory.speed_mps[i] = work.plan[i, 2]
        memory.margin_m[i] = work.clear[i, MARGIN]
        memory.static_m[i] = work.static[i, MARGIN] if work.rank[i] >= STATIC_LOST else 0.0
        memory.joint_m[i] = work.joint_m[i] if work.outnumbered[i] else 0.0
        if boats.table_steps[i] > 0:
            copy_row(memory.threat_m[i], work.threats_m[i])
        else:
            memory.threat_m[i, :] = work.threat_m[i]
        _note_backing_up(i, scene)
        note_pressing(i, scene)


@lean_kernel
def _note_causes(scene: Scene) -> None:
    """Note what each boat's wanted command is short of."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        plan.cause[i] = work.bound[i] if ours[i] and work.rank[i] < PAIR_SAFE else -1


@lean_kernel
def _name_static(scene: Scene) -> None:
    """Say of a command that was changed for static constraints, and keeps them now, that these bind and no boat."""
    ours, work, plan = scene.ours, scene.work, scene.plan
    for i in range(ours.shape[0]):
        if ours[i] and plan.cause[i] <= STATIC and work.rank[i] >= PAIR_SAFE and not unchanged(i, plan):
            work.bound[i] = plan.cause[i]


@lean_kernel
def finish(scene: Scene, safe: bool, count: int) -> None:
    """Name the reasons of a checked answer, or send the backups without one; then remember the backups."""
    if safe:
        mark_answer(count, QP, scene.plan)
    else:
        count = pick_movers(scene)
        back_up(count, scene)
    _name_static(scene)
    commit(scene)


@lean_kernel
def _take_in(state: Array, ours: BoolArray, scene: Scene) -> None:
    """Note what is to be decided about."""
    for i in range(ours.shape[0]):
        copy_row(scene.state[i], state[i])
        scene.ours[i] = ours[i]


@lean_kernel
def begin(scene: Scene, state: Array, wanted: Array, margin_m: Array, ours: BoolArray) -> int:
    """Screen the wanted commands, and finish where they pass; returns `PASSES`, `TO_SOLVE` or `TO_BACK_UP`."""
    _take_in(state, ours, scene)
    if screen(scene, wanted, margin_m):
        scene.plan.cause[:] = -1
        finish(scene, True, 0)
        return PASSES
    _note_causes(scene)
    return TO_BACK_UP if opposed(ours, scene.plan) else TO_SOLVE


@lean_kernel
def linearise(scene: Scene) -> tuple[int, int]:
    """Rows about the candidate commands: how many boats take part, and how many rows.

    -1 when there are too many, or the decision has cost its limit.
    """
    if all_spent(scene.tuning, scene.work):
        return 0, -1
    count = pick_movers(scene)
    return count, build(count, scene)


@lean_kernel
def accept(scene: Scene, z: Array, count: int) -> int:
    """Take an answer of the program and check it; returns `NO_ANSWER`, `UNSAFE` or `SAFE`."""
    if not take_answer(z, count, scene):
        return NO_ANSWER
    return SAFE if check(count, scene) else UNSAFE


@lean_kernel
def decide_compiled(scene: Scene, state: Array, wanted: Array, margin_m: Array, ours: BoolArray) -> None:
    """The whole decision for one game; sent commands are in ``plan.commands``, reasons in ``plan.reason``."""
    todo = begin(scene, state, wanted, margin_m, ours)
    if todo == PASSES:
        return
    found, count = UNSAFE, 0
    for _ in range(ROUNDS if todo == TO_SOLVE else 0):
        count, rows = linearise(scene)
        if rows < 0 or not solve_compiled(count, rows, scene.plan):
            break
        found = accept(scene, scene.plan.z, count)
        if found != UNSAFE:
            break
    finish(scene, found == SAFE, count)
