"""The hard line: the shield stops a boat beyond it, and before obstacles that nobody may touch.

The operating area yields to boats, because a boat that turns back into a pursuer is hit; so a boat may be chased far
out. Where the settings say "stop" (`ShieldConfig.beyond_then`), a boat beyond the hard line is stopped there, and no
command leads it onto an obstacle. Behind every command lies a manoeuvre or a stop that stays clear of all obstacles
until the boat is at rest. If a command has neither, the stop from now or the last manoeuvre still has one, by the same
rule. Teammates are verified against a stop as against any command: a decision in which a boat turns out to have to stop
is made again with that stop in it.
"""

from __future__ import annotations

from ..backup.assign import refresh, score_all
from ..backup.family import IN_MEMORY, candidate, remembered
from ..backup.paths import sail
from ..backup.rollout import roll_out
from ..backup.score import OPPONENTS
from ..barriers.clearance import FAR
from ..barriers.shapes import goes_through, to_circle, to_wall
from ..barriers.static import STATIC, beyond_line
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..workspace import BEST_EFFORT, GO_ON, HELD, MUST_STOP, NO_LAST_RESORT, STOPPED, Scene, Static
from .backup_switch import command_backup, slack_of
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
def _stays_clear(i: int, start: Array, side: float, togo_deg: float, speed_mps: float, scene: Scene) -> bool:
    """Return whether boat i stays clear from a state on: on a manoeuvre for the horizon, then stopping.

    At speed 0 and without a turn it stops from the first step on. A boat that is too near already must not come nearer.
    """
    boats, static, row, dt_s = scene.boats, scene.static, scene.row, scene.tuning.model_s
    params, x, y = boats.params[i], scene.state[i, L.X], scene.state[i, L.Y]
    least = min(0.0, _room(x, y, static)) - ROUNDING_M
    copy_row(row, start)
    if _through(x, y, row, static):
        return False
    run = boats.samples[i] * boats.stride if speed_mps > 0.0 or togo_deg > 0.0 else 0
    skip = 0
    for step in range(run + int(LONGEST_STOP_S / dt_s)):
        x, y = row[L.X], row[L.Y]
        if step < run:
            togo_deg = sail(params, row, side, togo_deg, speed_mps, dt_s)
        else:
            step_boat(params, row, 0.0, 0.0, dt_s)
        skip -= 1
        if skip <= 0:
            room = _room(row[L.X], row[L.Y], static)
            if room < least or _through(x, y, row, static):
                return False
            skip = int((room - least) / (max(boats.fastest_mps[i], row[L.SPEED]) * dt_s))
        if step >= run and row[L.SPEED] < AT_REST_MPS:
            return True
    return True


@lean_kernel
def _stop(i: int, scene: Scene) -> None:
    """Command boat i to stop on its course, and score that."""
    scene.command[i, 0], scene.command[i, 1] = 0.0, 0.0
    predict(i, scene.command, scene)
    roll_out(i, i, 1.0, 0.0, 0.0, 1, scene)
    refresh(i, scene)
    scene.reason[i], scene.bound[i] = STOPPED, STATIC


@lean_kernel
def _last_stays_clear(i: int, scene: Scene) -> bool:
    """Return whether boat i remembers a manoeuvre that stays clear."""
    state = scene.state
    if not remembered(i, 0, state[i, L.HEADING], scene):
        return False
    side, togo, speed = candidate(i, IN_MEMORY, 0.0, state[i, L.HEADING], scene)
    return _stays_clear(i, state[i], side, togo, speed, scene)


@lean_kernel
def _go_on_as_before(i: int, scene: Scene) -> None:
    """Command the remembered manoeuvre of boat i."""
    side, togo, speed = candidate(i, IN_MEMORY, 0.0, scene.state[i, L.HEADING], scene)
    roll_out(i, i, side, togo, speed, 0, scene)
    command_backup(i, scene)
    predict(i, scene.command, scene)
    side, togo, speed = candidate(i, IN_MEMORY, 0.0, scene.next_state[i, L.HEADING], scene)
    roll_out(i, i, side, togo, speed, 1, scene)
    refresh(i, scene)
    scene.reason[i], scene.bound[i] = BEST_EFFORT, STATIC


@lean_kernel
def _last_resort(i: int, scene: Scene) -> int:
    """Return what the hard line makes of boat i: nothing if a stop or its manoeuvre after the command stays clear."""
    static = scene.static
    if scene.last_resort[i] == MUST_STOP or beyond_line(i, scene):
        return MUST_STOP
    if static.last_circles + static.last_segments == 0:
        return NO_LAST_RESORT
    side, togo, speed = scene.manoeuvre[i, 0], scene.manoeuvre[i, 1], scene.manoeuvre[i, 2]
    if _stays_clear(i, scene.next_state[i], 1.0, 0.0, 0.0, scene) or _stays_clear(
        i, scene.next_state[i], side, togo, speed, scene
    ):
        return NO_LAST_RESORT
    stop = _stays_clear(i, scene.state[i], 1.0, 0.0, 0.0, scene) or not _last_stays_clear(i, scene)
    return MUST_STOP if stop else GO_ON


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
        if scene.ours[i] and scene.satisfied[i] < OPPONENTS and scene.reason[i] not in (STOPPED, HELD):
            scene.reason[i], scene.slack_m[i] = BEST_EFFORT, slack_of(i, scene)
