"""The nominal check: may the nominal commands be sent as they are? And the exact check of any candidate command.

Both predict one step with the full model, then score the backup that each boat has from there.

What does not pass is decided group by group. Two boats are in one group if they could meet, or could both meet boats of
that group (`barriers.neighbours`). A group's decision does not depend on other groups: a teammate far away changes
nothing, and many boats make many small problems.
"""

from __future__ import annotations

from .. import workspace as W
from ..backup.assign import assign_manoeuvres, recheck
from ..backup.score import CLEAR_OF_ALL
from ..barriers.clearance import FAR
from ..barriers.neighbours import find_neighbours
from ..barriers.registered import unknown_at
from ..barriers.static import beyond_line
from ..filter.right_of_way import apply_right_of_way
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..platforms.usv import wrap_degrees
from ..tables.grid import CAP
from ..workspace import Scene


@lean_kernel
def predict(i: int, commands: Array, scene: Scene) -> None:
    """Predict the state of boat i one step after its command, with the full boat and autopilot model."""
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    copy_row(scene.next_state[i], state[i])
    copy_row(scene.stepped[i], commands[i])
    step_boat(boats.params[i], scene.next_state[i], commands[i, 0], commands[i, 1], tuning.dt_s)


@lean_kernel
def predict_and_score(scene: Scene) -> None:
    """Predict the movers, and score every boat on the manoeuvre in ``scene.held``."""
    for i in range(scene.ours.shape[0]):
        if scene.moving[i]:
            predict(i, scene.command, scene)
    recheck(scene)


@lean_kernel
def _largest_tabled_m(i: int, j: int, scene: Scene) -> float:
    """Return the largest margin, m, that a table reports for a pair; beyond it a table reports infinity."""
    boats = scene.boats
    table = boats.table[i, j]
    if table < 0:
        return FAR
    return boats.tables.axes[table, CAP] - scene.radius[i, j] - boats.table_margin_m


@lean_kernel
def _required_m(decay: float, was_m: float, cap_m: float) -> float:
    """Return the margin, m, required one step after ``was_m``: the class-K rate, capped, never below 0."""
    return decay * max(0.0, min(was_m, cap_m))


@lean_kernel
def set_required_margins(scene: Scene) -> None:
    """Set the required margins: the discrete-time class-K condition h(x+) >= decay * min(h(x), cap), at least 0.

    Adversarial opponents have required margins of their own: one each for boats with value tables, one for all without.
    In a common one, a teammate's small but certain margin would let them shrink at once. The margin from own teammates
    may shrink freely until it is small: their commands are known.

    While a boat must hold its backup, the whole cap is required from each adversarial opponent.
    """
    ours, boats, tuning, memory = scene.ours, scene.boats, scene.tuning, scene.memory
    for i in range(ours.shape[0]):
        if not ours[i]:  # another group's are its own
            continue
        scene.target[i] = 0.0
        scene.teammate_target_m[i] = 0.0
        scene.pursuit_target_m[i, :] = 0.0
        scene.joint_target_m[i] = 0.0
        scene.static_target_m[i] = 0.0
        if memory[i, W.HAS_BACKUP] > 0.0:
            decay, cap_m = boats.decay[i], boats.cap_m[i]
            scene.target[i] = _required_m(decay, memory[i, W.BACKUP_MARGIN], cap_m)
            scene.teammate_target_m[i] = _required_m(
                decay, memory[i, W.BACKUP_MARGIN], min(tuning.teammate_margin_cap_m, cap_m)
            )
            scene.joint_target_m[i] = _required_m(boats.joint_decay, memory[i, W.JOINT_MARGIN], cap_m)
            scene.static_target_m[i] = _required_m(tuning.static_decay, memory[i, W.STATIC_MARGIN], tuning.margin_cap_m)
            for j in range(ours.shape[0]):
                most_m = min(cap_m, _largest_tabled_m(i, j, scene))
                kept_m = _required_m(decay, memory[i, W.N_MEMORY + j], most_m)
                scene.pursuit_target_m[i, j] = most_m if memory[i, W.HOLD_S] > 0.0 else kept_m


@lean_kernel
def check_nominal(scene: Scene) -> None:
    """Check the nominal commands: give every boat a manoeuvre after them, and score it.

    A command that is not usable (NaN, infinite, beyond `LARGEST_COMMAND`) becomes: hold course at zero speed. So does
    the command of a boat for whose position a registered barrier reports nothing. Boats that the hard line stops are
    stopped from the start, so that the others are checked against their stops.
    """
    state, ours = scene.state, scene.ours
    n, nominal = state.shape[0], scene.nominal
    find_neighbours(scene)
    set_required_margins(scene)
    for i in range(n):
        copy_row(scene.command[i], nominal[i])
        scene.slack_m[i] = 0.0
        scene.moving[i] = False
        scene.solver[i] = 0
        scene.reason[i] = W.PASSED if ours[i] else W.NOT_COVERED
        if not ours[i]:
            continue
        usable = abs(nominal[i, 0]) <= W.LARGEST_COMMAND and abs(nominal[i, 1]) <= W.LARGEST_COMMAND
        if not usable or unknown_at(i, scene) >= 0:
            scene.command[i, 0], scene.command[i, 1] = 0.0, 0.0
            scene.reason[i] = W.HELD
        if beyond_line(i, scene) or scene.last_resort[i] == W.MUST_STOP:
            scene.command[i, 0], scene.command[i, 1], scene.reason[i] = 0.0, 0.0, W.STOPPED
        else:
            apply_right_of_way(i, scene)
        predict(i, scene.command, scene)
        scene.checked_turn[i] = wrap_degrees(scene.next_state[i, L.HEADING] - state[i, L.HEADING])
    for i in range(n):
        copy_row(scene.checked[i], scene.command[i])
        scene.checked_reason[i] = scene.reason[i]
    assign_manoeuvres(scene, 1, ours)


NOT_OURS, NONE, NOT_YET = -1, -2, -3
"""Group numbers of other boats; of groups whose nominal commands satisfy everything; of boats not yet checked."""


@lean_kernel
def _gather(first: int, group: int, scene: Scene) -> bool:
    """Number boat ``first`` and its whole group; return whether any of them violates something."""
    ours, groups, queue = scene.ours, scene.group, scene.movers
    groups[first], queue[0] = group, first
    done, found, short = 0, 1, False
    while done < found:
        i = queue[done]
        done += 1
        short = short or scene.satisfied[i] < CLEAR_OF_ALL
        for j in range(ours.shape[0]):
            if groups[j] == NOT_YET and scene.neighbours[i, j]:
                groups[j], queue[found] = group, j
                found += 1
    if not short:
        for k in range(found):
            groups[queue[k]] = NONE
    return short


@lean_kernel
def make_groups(scene: Scene) -> int:
    """Number, in ``scene.group``, the groups in which a nominal command fails; return how many."""
    ours, groups = scene.ours, scene.group
    for i in range(ours.shape[0]):
        groups[i] = NOT_YET if ours[i] else NOT_OURS
    count = 0
    for i in range(ours.shape[0]):
        if groups[i] == NOT_YET and _gather(i, count, scene):
            count += 1
    return count


@lean_kernel
def open_group(group: int, scene: Scene) -> None:
    """Decide only for the boats of one group, from now on."""
    ours, groups = scene.ours, scene.group
    for i in range(ours.shape[0]):
        ours[i] = groups[i] == group
        scene.moving[i] = False


@lean_kernel
def close_groups(scene: Scene) -> None:
    """Decide for all own boats again."""
    for i in range(scene.ours.shape[0]):
        scene.ours[i] = scene.group[i] != NOT_OURS
