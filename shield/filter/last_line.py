"""The hard line: the shield stops a boat beyond it, and before obstacles that nobody may touch.

The operating area yields to boats, because a boat that turns back into a pursuer is hit; so a boat may be chased far
out. Where the settings say "stop" (`ShieldConfig.beyond_then`), a boat beyond the hard line is stopped there, and no
command leads it onto an obstacle. Behind every command lies a stop, at once or at some time on a manoeuvre, that stays
clear of all obstacles until the boat is at rest. If a command has none, the stop from now or the last manoeuvre still
has one, by the same rule. Teammates are verified against a stop as against any command: a decision in which a boat
turns out to have to stop is made again with that stop in it.
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.assign import refresh, score_all
from ..backup.family import IN_MEMORY, candidate, remembered, turn_left
from ..backup.rollout import roll_out
from ..backup.score import CLEAR_OF_BOATS
from ..barriers.clearance import FAR
from ..barriers.static import STATIC, beyond_line, goes_through, to_circle, to_wall
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..platforms.usv import speed_of_thrust
from ..workspace import BEST_EFFORT, GO_ON, HELD, MUST_STOP, NO_LAST_RESORT, STOPPED, Scene, Static
from .backup_switch import command_backup, first_command, slack_of
from .nominal import predict

AT_REST_MPS = 0.05
"""Speed below which a boat counts as stopped, m/s."""

ROUNDING_M = 1e-6
"""A boat that is already too near may come nearer by this, m."""

LONGEST_STOP_S = 90.0
"""Time after a stop command at which a boat counts as stopped, s."""


@lean_kernel
def _room(x: float, y: float, static: Static) -> float:
    """Return the distance to everything that stops boats, m; negative where it is touched."""
    least = FAR
    for c in range(static.last_circles):
        least = min(least, to_circle(x, y, static.circles[c])[0])
    for w in range(static.last_segments):
        least = min(least, to_wall(x, y, static.segments[w], static.segment_m)[0])
    return least + static.last_m


@lean_kernel
def _through(x: float, y: float, row: Array, static: Static) -> bool:
    """Return whether the way from a position to that of a state crosses a wall."""
    through = False
    for w in range(static.last_segments):
        through = through or goes_through(x, y, row[L.X], row[L.Y], static.segments[w])
    return through


@lean_kernel
def _is_at_rest(row: Array, params: Array) -> bool:
    """Return whether a boat lies still, and is not kept from its speed by the turn it makes."""
    pushed_mps = speed_of_thrust(params, row[L.THRUST]) if params[L.KIND] == L.KIND_USV else 0.0
    return max(row[L.SPEED], pushed_mps) < AT_REST_MPS


@lean_kernel
def _stop_stays_clear(i: int, start: Array, x: float, y: float, least_m: float, scene: Scene) -> bool:
    """Return whether boat i, which came from (x, y), keeps room of ``least_m`` if it stops from a state on."""
    boats, static, row, dt_s = scene.boats, scene.static, scene.stop_row, scene.tuning.model_s
    copy_row(row, start)
    skip = 0
    for step in range(int(LONGEST_STOP_S / dt_s)):
        if skip <= 0:
            room = _room(row[L.X], row[L.Y], static)
            if room < least_m or _through(x, y, row, static):
                return False
            skip = int((room - least_m) / (max(boats.fastest_mps[i], row[L.SPEED]) * dt_s))
        if step > 0 and _is_at_rest(row, boats.params[i]):
            return True
        x, y, skip = row[L.X], row[L.Y], skip - 1
        step_boat(boats.params[i], row, 0.0, 0.0, dt_s)
    return True


@lean_kernel
def _stays_clear(i: int, start: Array, rudder: float, togo_deg: float, speed_mps: float, scene: Scene) -> bool:
    """Return whether boat i stays clear from a state on if it stops at once, or at some time on a manoeuvre.

    At any time: where a manoeuvre stays clear only if it is left in time, what is left of it after a step does so, too.
    For the same reason the boat follows its commands here. A boat that is too near already must not come nearer.
    """
    tuning, static, row, params = scene.tuning, scene.static, scene.row, scene.boats.params[i]
    x, y, end_deg = scene.state[i, L.X], scene.state[i, L.Y], np.nan
    least_m = min(0.0, _room(x, y, static)) - ROUNDING_M
    copy_row(row, start)
    if togo_deg > 0.0:
        end_deg = row[L.HEADING] + math.copysign(togo_deg, rudder)
    for _ in range(scene.boats.samples[i] * scene.boats.stride // tuning.moves + 1):
        if _stop_stays_clear(i, row, x, y, least_m, scene):
            return True
        error_deg = first_command(i, row, rudder, turn_left(row[L.HEADING], end_deg, rudder), speed_mps, scene)
        for _ in range(tuning.moves):
            if _room(row[L.X], row[L.Y], static) < least_m or _through(x, y, row, static):
                return False
            x, y = row[L.X], row[L.Y]
            step_boat(params, row, speed_mps, error_deg, tuning.model_s)
    return False


@lean_kernel
def _stop(i: int, scene: Scene) -> None:
    """Command boat i to stop on its course, and score that."""
    scene.command[i, 0], scene.command[i, 1] = 0.0, 0.0
    predict(i, scene.command, scene)
    roll_out(i, i, 1.0, 0.0, 0.0, 1, scene)
    refresh(i, scene)
    scene.reason[i], scene.active[i] = STOPPED, STATIC


@lean_kernel
def _last_stays_clear(i: int, scene: Scene) -> bool:
    """Return whether boat i must not stop at once, but remembers a manoeuvre that stays clear."""
    state = scene.state
    x, y = state[i, L.X], state[i, L.Y]
    least_m = min(0.0, _room(x, y, scene.static)) - ROUNDING_M
    stops = _stop_stays_clear(i, state[i], x, y, least_m, scene)
    if stops or not remembered(i, 0, state[i, L.HEADING], scene):
        return False
    rudder, togo, speed = candidate(i, IN_MEMORY, 0.0, state[i, L.HEADING], scene)
    return _stays_clear(i, state[i], rudder, togo, speed, scene)


@lean_kernel
def _go_on_as_before(i: int, scene: Scene) -> None:
    """Command the remembered manoeuvre of boat i."""
    rudder, togo, speed = candidate(i, IN_MEMORY, 0.0, scene.state[i, L.HEADING], scene)
    roll_out(i, i, rudder, togo, speed, 0, scene)
    command_backup(i, scene)
    predict(i, scene.command, scene)
    rudder, togo, speed = candidate(i, IN_MEMORY, 0.0, scene.next_state[i, L.HEADING], scene)
    roll_out(i, i, rudder, togo, speed, 1, scene)
    refresh(i, scene)
    scene.reason[i], scene.active[i] = BEST_EFFORT, STATIC


@lean_kernel
def _last_resort(i: int, scene: Scene) -> int:
    """Return what the hard line makes of boat i: nothing if a stop or its manoeuvre after the command stays clear."""
    static = scene.static
    if scene.last_resort[i] == MUST_STOP or beyond_line(i, scene):
        return MUST_STOP
    if static.last_circles + static.last_segments == 0:
        return NO_LAST_RESORT
    rudder, togo, speed = scene.manoeuvre[i, 0], scene.manoeuvre[i, 1], scene.manoeuvre[i, 2]
    if _stays_clear(i, scene.next_state[i], rudder, togo, speed, scene):
        return NO_LAST_RESORT
    return GO_ON if _last_stays_clear(i, scene) else MUST_STOP


@lean_kernel
def note_last_resorts(scene: Scene) -> bool:
    """Note what the hard line makes of every boat; return whether one must stop that was not to stop so far."""
    new = False
    for i in range(scene.ours.shape[0]):
        if scene.ours[i]:
            scene.last_resort[i] = _last_resort(i, scene)
            new = new or (scene.last_resort[i] == MUST_STOP and scene.reason[i] != STOPPED)
    return new


@lean_kernel
def keep_last_line(scene: Scene) -> None:
    """Stop the boats that must stop, and let those that cannot even stop go on as before.

    The others were not verified against the latter: one that is left short by it says so.
    """
    going_on = False
    for i in range(scene.ours.shape[0]):
        if scene.ours[i] and scene.last_resort[i] == MUST_STOP:
            _stop(i, scene)
        elif scene.ours[i] and scene.last_resort[i] == GO_ON:
            _go_on_as_before(i, scene)
            going_on = True
    if not going_on:
        return
    score_all(scene)
    for i in range(scene.ours.shape[0]):
        if scene.ours[i] and scene.satisfied[i] < CLEAR_OF_BOATS and scene.reason[i] not in (STOPPED, HELD):
            scene.reason[i], scene.slack_m[i] = BEST_EFFORT, slack_of(i, scene)
