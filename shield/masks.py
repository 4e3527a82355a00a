"""Action masks: which candidate commands the shield would pass unchanged in this step.

A candidate of a boat passes if the boat, one step after it, satisfies everything on its backup while its teammates go
straight on. This is the nominal check of that boat alone. Neighbours, required margins and the backup are found once
for all candidates, and candidates that lead to the same state are checked once.

A mask covers this step only, not later ones, nor teammates' candidates. Boats stay apart because the shield still
filters the chosen command.
"""

from __future__ import annotations

import math

import numpy as np

from .backup.assign import choose_manoeuvre, needs_no_search, note_manoeuvre
from .backup.family import found_turn
from .backup.rollout import roll_out
from .backup.score import CLEAR_OF_ALL, CLEAR_OF_BOATS, Score, score_path
from .barriers.clearance import FAR
from .barriers.registered import unknown_at
from .barriers.static import beyond_line
from .decide import Deciders, load_decision
from .filter.nominal import check_nominal, predict
from .filter.right_of_way import apply_right_of_way
from .jit import Array, BoolArray, copy_row, kernel, lean_kernel
from .platforms import layout as L
from .workspace import LARGEST_COMMAND, PASSED, Scene, Static

SHORT_OF_ALL = Score(CLEAR_OF_BOATS, -FAR)
"""Manoeuvres are scored only as far as needed to decide whether they satisfy everything."""


@lean_kernel
def _begin(b: int, scene: Scene) -> None:
    """Find what all candidates of a decision share: neighbours, required margins, backups of boats going straight."""
    for i in range(scene.ours.shape[0]):
        if scene.ours[i]:
            scene.nominal[i, 0], scene.nominal[i, 1] = scene.state[i, L.SPEED], 0.0
    check_nominal(scene)
    for i in range(scene.ours.shape[0]):
        copy_row(scene.memory[i], scene.memories[b, i])
        if scene.ours[i]:
            note_manoeuvre(i, scene.held, scene)


@lean_kernel
def _goes_out(i: int, b: int, asked: Array, scene: Scene) -> bool:
    """Make a candidate boat i's command; return whether the shield would check it unmodified."""
    if not (abs(asked[0]) <= LARGEST_COMMAND and abs(asked[1]) <= LARGEST_COMMAND):
        return False
    turned = scene.state[i, L.HEADING] - scene.given[b, i, L.HEADING]  # until the command takes effect
    scene.command[i, 0], scene.command[i, 1] = asked[0], asked[1] - turned if turned != 0.0 else asked[1]
    copy_row(scene.memory[i], scene.memories[b, i])
    scene.reason[i] = PASSED
    apply_right_of_way(i, scene)
    return scene.reason[i] == PASSED


@lean_kernel
def _same_from_here(i: int, other: Array, scene: Scene) -> bool:
    """Return whether boat i's manoeuvres are the same from its predicted state as from another.

    Manoeuvres of thrust boats do not depend on the memory of their steering. In a step of several moves, boats that
    end at the same place may have been elsewhere in between.
    """
    row, params = scene.next_state[i], scene.boats.params[i]
    plain = params[L.KIND] == L.KIND_USV and params[L.ROTATE_SPEED] == 0.0
    if scene.tuning.moves > 1:
        return False
    for k in range(L.N_STATE):
        of_steering = k in (L.RUDDER, L.HEADING_ERROR, L.HEADING_INTEGRAL, L.TURN_RATE)
        both_nan = math.isnan(row[k]) and math.isnan(other[k])
        if row[k] != other[k] and not both_nan and not (plain and of_steering):
            return False
    return True


@lean_kernel
def _has_backup(i: int, scene: Scene) -> bool:
    """Return whether boat i satisfies everything on its held backup from its predicted state, or on one found now."""
    trial, held = scene.state.shape[0], scene.held
    togo_deg = found_turn(i, scene.next_state[i, L.HEADING], held)
    roll_out(i, trial, held[i, 0], togo_deg, held[i, 2], 1, scene)
    scene.satisfied[i], scene.score_m[i] = score_path(i, trial, SHORT_OF_ALL, scene)
    if scene.satisfied[i] == CLEAR_OF_ALL or scene.searched[i] > 0 or needs_no_search(i, 0, 1, scene):
        return scene.satisfied[i] == CLEAR_OF_ALL
    scene.searched[i], scene.spent[0] = 1, 0.0
    choose_manoeuvre(i, scene.command[i, 0], 1, False, scene)
    if scene.satisfied[i] == CLEAR_OF_ALL:
        note_manoeuvre(i, held, scene)
    return scene.satisfied[i] == CLEAR_OF_ALL


@lean_kernel
def _passing(i: int, b: int, candidates: Array, states: Array, passes: BoolArray, scene: Scene) -> None:
    """Check all candidates of boat i, (k, 2)."""
    scene.searched[i] = -1
    stopped = beyond_line(i, scene) or unknown_at(i, scene) >= 0
    for k in range(candidates.shape[0]):
        states[k, L.X] = np.nan  # equals no state, while nothing is predicted
        passes[k] = not stopped and _goes_out(i, b, candidates[k], scene)
        if not passes[k]:
            continue
        predict(i, scene.command, scene)
        alike = 0
        while alike < k and not _same_from_here(i, states[alike], scene):
            alike += 1
        copy_row(states[k], scene.next_state[i])
        passes[k] = passes[alike] if alike < k else _has_backup(i, scene)
    if scene.searched[i] > 0:  # teammates are scored beside it as it goes straight on
        scene.command[i, 0], scene.command[i, 1] = scene.state[i, L.SPEED], 0.0
        predict(i, scene.command, scene)
        togo_deg = found_turn(i, scene.next_state[i, L.HEADING], scene.held)
        roll_out(i, i, scene.held[i, 0], togo_deg, scene.held[i, 2], 1, scene)


@kernel
def _pass_all(scene: Scene, candidates: Array, passes: BoolArray) -> None:
    """Write which candidates (B, n, k, 2) pass, (B, n, k); those of boats not decided for all do."""
    states = np.empty((candidates.shape[2], L.N_STATE))
    for b in range(candidates.shape[0]):
        load_decision(b, scene)
        _begin(b, scene)
        for i in range(candidates.shape[1]):
            passes[b, i, :] = True
            if scene.ours[i]:
                _passing(i, b, candidates[b, i], states, passes[b, i], scene)


def passing(deciders: Deciders, static: Static, candidates: Array) -> BoolArray:
    """Return which of k candidates (B, n, k, 2), m/s and relative heading deg, pass, (B, n, k); nothing is remembered.

    Args:
        deciders: deciders to which everything but the commands is given.
        static: static constraints.
        candidates: each boat's own.
    """
    passes = np.empty(candidates.shape[:-1], np.bool_)
    _pass_all(deciders.beside(static), np.ascontiguousarray(candidates, np.float64), passes)
    return passes
