"""The backups: where a nominal command fails the check, boats switch to a verified joint plan.

Every command that is sent has a verified joint plan behind it: for each own boat, a manoeuvre that stays clear of
everything from the state one step ahead. If the nominal commands have no such plan, the boats continue the last one or
take a better one. So a verified plan, once found, exists at every step, unless an opponent does what no manoeuvre had
to allow for.

Against opponents the shield sends the whole backup, because too little is known of boats that others command: minimal
changes prolonged the encounters in which they were tried. Other backups are reduced to the least change, see `qp` and
`blend`.

The switching is that of backup filters: Gurriet et al. 2020 (IEEE Access 8), Agrawal, Chen, Panagou 2024 (gatekeeper).
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.assign import assign_manoeuvres, score_all
from ..backup.family import IN_MEMORY, candidate, remembered
from ..backup.rollout import roll_out
from ..backup.score import (
    CLEAR_OF_ALL,
    CLEAR_OF_BOATS,
    CLEAR_OF_KNOWN,
    CLEAR_OF_OBSTACLES,
    WORST,
    Score,
    better,
    score_of,
    score_path,
)
from ..barriers.boats import reported_margin
from ..barriers.clearance import MARGIN
from ..barriers.static import clear_of_near_obstacles
from ..barriers.value_function import run_opponents
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn, full_turn
from ..workspace import BACKUP, BEST_EFFORT, STOPPED, Scene
from .nominal import predict_and_score


@lean_kernel
def pick_movers(scene: Scene) -> int:
    """Pick the boats whose nominal command fails, and the teammates it fails against; a mover stays one."""
    ours = scene.ours
    n = ours.shape[0]
    for i in range(n):
        if ours[i] and scene.satisfied[i] < CLEAR_OF_ALL:
            scene.moving[i] = True
            j = scene.active[i]
            if j >= 0 and ours[j]:
                scene.moving[j] = True
    return list_movers(scene)


@lean_kernel
def list_movers(scene: Scene) -> int:
    """List and number the movers; return how many there are."""
    count = 0
    for i in range(scene.moving.shape[0]):
        scene.mover_of[i] = -1
        if scene.moving[i]:
            scene.movers[count], scene.mover_of[i] = i, count
            count += 1
    return count


@lean_kernel
def slack_of(i: int, scene: Scene) -> float:
    """Return by how much boat i violates its distance from boats and static constraints, m."""
    least = reported_margin(i, scene)
    if scene.satisfied[i] >= CLEAR_OF_BOATS:
        least = min(least, scene.static_clear[i, MARGIN])
    if scene.satisfied[i] == CLEAR_OF_KNOWN:  # of an obstacle near in time nothing else is noted
        clear_of_near_obstacles(i, i, scene, 0.0, scene.scratch_clear)
        least = min(least, scene.scratch_clear[MARGIN])
    return max(0.0, -least)


@lean_kernel
def first_command(i: int, row: Array, rudder: float, togo_deg: float, speed_mps: float, scene: Scene) -> float:
    """Return the heading error, deg, that begins a manoeuvre of boat i from a state: its autopilot's inverse."""
    params, dt_s = scene.boats.params[i], scene.tuning.dt_s
    if togo_deg > 0.0:
        togo_deg = min(togo_deg, abs(rudder) * full_turn(params, row, speed_mps, dt_s))
    return command_for_turn(params, row, speed_mps, math.copysign(togo_deg, rudder), dt_s)


@lean_kernel
def command_backup(i: int, scene: Scene) -> None:
    """Command the first step of boat i's backup."""
    state, held, manoeuvre = scene.state[i], scene.held[i], scene.manoeuvre[i]
    rudder, togo, speed = manoeuvre[0], manoeuvre[1], manoeuvre[2]
    held[0], held[1], held[2] = rudder, np.nan, speed
    if togo > 0.0:
        held[1] = state[L.HEADING] + math.copysign(togo, rudder)
    scene.command[i, 0], scene.command[i, 1] = speed, first_command(i, state, rudder, togo, speed, scene)


@lean_kernel
def _score_without_passed(i: int, slot: int, scene: Scene) -> Score:
    """Score boat i's path in ``slot`` as if teammates whose nominal commands passed were absent."""
    ours = scene.ours
    for j in range(ours.shape[0]):
        if ours[j] and not scene.moving[j]:
            scene.neighbours[i, j] = False
    score = score_path(i, slot, WORST, scene)
    for j in range(ours.shape[0]):
        if ours[j] and not scene.moving[j]:
            scene.neighbours[i, j] = scene.neighbours[j, i]
    return score


@lean_kernel
def _passed_block(count: int, scene: Scene) -> bool:
    """Return whether a mover would score better without the teammates whose nominal commands passed.

    A boat that opponents or static constraints leave no way out is not helped by a teammate that gives up its command.
    """
    state = scene.state
    trial = state.shape[0]
    for m in range(count):
        i = scene.movers[m]
        if scene.satisfied[i] == CLEAR_OF_ALL:
            continue
        if better(_score_without_passed(i, i, scene), score_of(i, scene)):
            return True
        heading = state[i, L.HEADING]
        if not remembered(i, 0, heading, scene):
            continue
        rudder, togo, speed = candidate(i, IN_MEMORY, 0.0, heading, scene)
        roll_out(i, trial, rudder, togo, speed, 0, scene)
        if better(_score_without_passed(i, trial, scene), score_of(i, scene)):
            return True
    return False


@lean_kernel
def _mates_meet(count: int, scene: Scene) -> bool:
    """Return whether a mover's backup comes too near to a teammate: those that passed may leave it room elsewhere."""
    for m in range(count):
        i = scene.movers[m]
        if scene.satisfied[i] < CLEAR_OF_KNOWN and scene.active[i] >= 0 and scene.ours[scene.active[i]]:
            return True
    return False


@lean_kernel
def _join(scene: Scene) -> int:
    """Make movers of own boats that could meet movers; return the number of movers."""
    ours = scene.ours
    for i in range(ours.shape[0]):
        for m in range(ours.shape[0]):
            if ours[i] and scene.mover_of[m] >= 0 and scene.neighbours[i, m]:
                scene.moving[i] = True
    return list_movers(scene)


@lean_kernel
def _join_short(scene: Scene) -> int:
    """Make movers of own boats that passed and that the movers' backups come too near; return the number of movers."""
    ours = scene.ours
    for i in range(ours.shape[0]):
        if ours[i] and scene.satisfied[i] < CLEAR_OF_OBSTACLES:
            scene.moving[i] = True
    return list_movers(scene)


@lean_kernel
def _assign_backups(count: int, scene: Scene) -> bool:
    """Find backups of the movers from the present state; return whether all own boats then stay clear.

    Opponents are left where boats with tables look them up on such manoeuvres.
    """
    ours, boats = scene.ours, scene.boats
    table_steps = 1
    for i in range(ours.shape[0]):
        scene.target[i] = 0.0
        scene.teammate_target_m[i] = 0.0
    for m in range(count):
        i = scene.movers[m]
        scene.pursuit_target_m[i, :] = 0.0
        scene.joint_target_m[i] = 0.0
        scene.static_target_m[i] = 0.0
        table_steps = max(table_steps, boats.table_steps[i])
    run_opponents(table_steps, scene)
    return assign_manoeuvres(scene, 0, scene.moving)


@lean_kernel
def _worst_off(scene: Scene) -> Score:
    """Return the score of the own boat that is worst off."""
    worst = Score(CLEAR_OF_ALL + 1, 0.0)
    for i in range(scene.ours.shape[0]):
        if scene.ours[i] and better(worst, score_of(i, scene)):
            worst = score_of(i, scene)
    return worst


@lean_kernel
def _stop_if_better(count: int, scene: Scene) -> None:
    """Make all movers stop instead, where the boat that is worst off is better off so.

    The search changes the manoeuvre of one boat at a time. Of several that are near each other and would all have to
    stop, none is better off if it alone does.
    """
    found = _worst_off(scene)
    for m in range(count):
        i = scene.movers[m]
        if scene.reason[i] != STOPPED:  # those stop already, and what they hold is not written again
            copy_row(scene.held[i], scene.manoeuvre[i])
            roll_out(i, i, 1.0, 0.0, 0.0, 0, scene)
    score_all(scene)
    if better(_worst_off(scene), found):
        return
    for m in range(count):
        i = scene.movers[m]
        if scene.reason[i] != STOPPED:
            roll_out(i, i, scene.held[i, 0], scene.held[i, 1], scene.held[i, 2], 0, scene)
    score_all(scene)


@lean_kernel
def _find_backups(count: int, scene: Scene) -> None:
    """Make a candidate of all movers' backups and check it.

    All own boats had backups that fit at the last decision; these are tried first. The movers' backups may conflict
    with boats whose nominal commands passed. If these block a mover, or are too near to one, they become movers as
    well.
    """
    ours = scene.ours
    for _ in range(ours.shape[0]):
        if _assign_backups(count, scene):
            break
        movers = _join(scene) if _passed_block(count, scene) or _mates_meet(count, scene) else _join_short(scene)
        if movers == count:
            break
        count = movers
    if count > 1 and _worst_off(scene).satisfied < CLEAR_OF_BOATS:
        _stop_if_better(count, scene)
    run_opponents(1, scene)
    for m in range(count):
        if scene.reason[scene.movers[m]] != STOPPED:
            command_backup(scene.movers[m], scene)
    predict_and_score(scene)


@lean_kernel
def back_up(scene: Scene) -> None:
    """Make backups the commands of boats that violate something, and of boats that block them.

    The reason is BACKUP, or BEST_EFFORT where the backup still violates something: the shield never switches itself
    off.
    """
    ours = scene.ours
    _find_backups(pick_movers(scene), scene)
    for i in range(ours.shape[0]):
        keeps = scene.satisfied[i] >= CLEAR_OF_BOATS
        if ours[i] and scene.reason[i] != STOPPED and (scene.moving[i] or not keeps):
            scene.reason[i] = BACKUP if keeps else BEST_EFFORT
            scene.slack_m[i] = slack_of(i, scene)
