"""Right of way: when two teammates keep each other from turning, one turns away and the other stands on.

Two boats on nearly the same course may each want to go where the other is. Every decision is then safe, and neither
boat ever arrives: a deadlock. The symmetry is broken as in the rules of the road, by what each boat sees of the other.
The boat behind, or with the other on its starboard side, gives way and turns away; the other holds its course. Boats
that can stop at once may stand still before each other instead. Each of them then goes round the other, which it keeps
to port: a roundabout. The shield checks these commands like any others.

An opponent does not follow this rule; whole backups clear it.

Source on deadlocks between robots behind barriers, and on consistent sides: Wang, Ames, Egerstedt, "Safety barrier
certificates for collisions-free multirobot systems", IEEE T-RO 33(3), 2017.
"""

from __future__ import annotations

import math

from .. import workspace as W
from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..workspace import Scene, unchanged

NEAR_M = 2.0
"""Distance beyond the required one within which a boat is alongside, m."""
ALIKE_DEG = 45.0
"""Courses that differ by no more count as nearly the same."""
PRESSING_DEG = 15.0
"""A smaller nominal turn is steady steering."""
TURNED_DEG = 20.0
"""A boat that has turned this far to its nominal side is not kept from turning."""
FREED_S = 1.0
"""A boat whose nominal command has passed for longer is not kept from turning, s."""
AWAY_DEG = 120.0
"""Turn commanded to the boat that gives way."""
ABREAST_M = 1.0
"""A boat behind by no more is abreast, m."""
CLEAR_M = 3.0
"""Distance beyond the required one at which the boat that gave way is clear of the other, m."""
LONGEST_S = 20.0
"""Longest time a boat gives way, s."""
STILL_MPS = 0.2
"""A boat with a nominal speed up to this does not want to go anywhere."""
PATIENCE = 3.0
"""Factor on the waiting time of a boat with right of way before it gives way nevertheless."""
GOES_ROUND = 2.0
"""``memory[i, GIVES_WAY]`` of a boat that goes round another; -1 and 1 are turns away to port and to starboard."""
ROUND_DEG = 95.0
"""Course round another boat, from its bearing to starboard: a little outward, so that the distance does not shrink."""
ON_COURSE_DEG = 10.0
"""A boat that goes round another, and need not go to steer, turns where it lies until its course is as near as this."""


@lean_kernel
def _alongside(i: int, turn_deg: float, speed_mps: float, scene: Scene) -> int:
    """Return the nearest teammate alongside boat i on the side it wants to turn to; -1 for none."""
    state, ours = scene.state, scene.ours
    found, least = -1, math.inf
    if speed_mps <= STILL_MPS or abs(turn_deg) <= PRESSING_DEG:
        return found
    east, north = math.sin(math.radians(state[i, L.HEADING])), math.cos(math.radians(state[i, L.HEADING]))
    for j in range(state.shape[0]):
        if (
            j == i
            or not ours[j]
            or not scene.neighbours[i, j]
            or abs(wrap_degrees(state[j, L.HEADING] - state[i, L.HEADING])) > ALIKE_DEG
        ):
            continue
        dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
        gap, starboard = math.sqrt(dx * dx + dy * dy), dx * north - dy * east
        if starboard * turn_deg > 0.0 and gap < scene.radius[i, j] + NEAR_M and gap < least:
            found, least = j, gap
    return found


@lean_kernel
def _stands_on(i: int, j: int, state: Array) -> bool:
    """Return whether boat i is ahead of j, or abreast to starboard of it, by mean course: j finds the opposite."""
    own, other = math.radians(state[i, L.HEADING]), math.radians(state[j, L.HEADING])
    east, north = math.sin(own) + math.sin(other), math.cos(own) + math.cos(other)
    length = math.sqrt(east * east + north * north)
    if length > 0.0:
        east, north = east / length, north / length
    dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
    ahead = dx * east + dy * north
    if abs(ahead) > ABREAST_M:
        return ahead < 0.0
    return dx * north - dy * east < 0.0


@lean_kernel
def _stands(i: int, speed_mps: float, scene: Scene) -> bool:
    """Return whether boat i lies still although it wants to go somewhere."""
    return speed_mps > STILL_MPS and abs(scene.state[i, L.SPEED]) <= STILL_MPS


@lean_kernel
def _needs_way(params: Array) -> bool:
    """Return whether a boat has to go to steer."""
    kind = params[L.KIND]
    return kind == L.KIND_USV or (kind == L.KIND_RATE and params[L.TURN_AT_REST] == 0.0)


@lean_kernel
def _still_near(i: int, scene: Scene) -> int:
    """Return the teammate that boat i stopped for if it is still alongside; -1 for none."""
    j = int(scene.memory[i, W.BLOCKED_BY])
    if j < 0 or not scene.ours[j] or not scene.neighbours[i, j]:
        return -1
    gap = math.hypot(scene.state[j, L.X] - scene.state[i, L.X], scene.state[j, L.Y] - scene.state[i, L.Y])
    return j if gap < scene.radius[i, j] + NEAR_M else -1


@lean_kernel
def _is_ahead(i: int, j: int, turn_deg: float, state: Array) -> bool:
    """Return whether boat j is not yet abaft boat i's beam on its nominal course."""
    course = math.radians(state[i, L.HEADING] + turn_deg)
    dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
    return dx * math.sin(course) + dy * math.cos(course) > 0.0


@lean_kernel
def _who_blocks(i: int, turn_deg: float, speed_mps: float, scene: Scene) -> int:
    """Return the boat that still keeps boat i from turning as it wants; -1 for none."""
    state, memory = scene.state, scene.memory
    if memory[i, W.HAS_BACKUP] == 0.0 or memory[i, W.DEADLOCK_S] <= 0.0 or memory[i, W.FREE_S] > FREED_S:
        return -1
    turned_deg = wrap_degrees(state[i, L.HEADING] - memory[i, W.DEADLOCK_DEG])
    if _stands(i, speed_mps, scene):
        return _still_near(i, scene)
    if turned_deg * math.copysign(1.0, turn_deg) >= TURNED_DEG:
        return -1
    return _alongside(i, turn_deg, speed_mps, scene)


@lean_kernel
def _goes_on(i: int, turn_deg: float, speed_mps: float, scene: Scene) -> bool:
    """Return whether boat i must still give way: until it is clear, or wants to turn the way it gives way to."""
    state, ours, memory = scene.state, scene.ours, scene.memory
    j = int(memory[i, W.BLOCKED_BY])
    if j < 0 or not ours[j] or not scene.neighbours[i, j] or memory[i, W.HAS_BACKUP] == 0.0:
        return False
    if speed_mps <= STILL_MPS or memory[i, W.DEADLOCK_S] >= LONGEST_S:
        return False
    gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
    if memory[i, W.GIVES_WAY] == GOES_ROUND:
        wants = _is_ahead(i, j, turn_deg, state)
    else:
        wants = turn_deg * memory[i, W.GIVES_WAY] < 0.0
    return wants and gap < scene.radius[i, j] + CLEAR_M


@lean_kernel
def _press(i: int, turn_deg: float, speed_mps: float, scene: Scene) -> None:
    """Count on how long boat i has been kept from turning, and decide whether it gives way."""
    state, tuning, memory = scene.state, scene.tuning, scene.memory
    j = _who_blocks(i, turn_deg, speed_mps, scene)
    if j < 0:
        memory[i, W.DEADLOCK_S] = 0.0
    elif j != int(memory[i, W.BLOCKED_BY]):
        memory[i, W.DEADLOCK_S] = tuning.dt_s
    memory[i, W.BLOCKED_BY] = j
    if j < 0:
        return
    if memory[j, W.GIVES_WAY] != 0.0 and int(memory[j, W.BLOCKED_BY]) == i:
        return
    memory[i, W.DEADLOCK_S] += tuning.dt_s
    if _stands(i, speed_mps, scene):
        if memory[i, W.DEADLOCK_S] >= tuning.deadlock_timeout_s:
            memory[i, W.GIVES_WAY], memory[i, W.DEADLOCK_S] = GOES_ROUND, tuning.dt_s
        return
    patience = PATIENCE if _stands_on(i, j, state) else 1.0
    if memory[i, W.DEADLOCK_S] >= patience * tuning.deadlock_timeout_s:
        memory[i, W.GIVES_WAY], memory[i, W.DEADLOCK_S] = -math.copysign(1.0, turn_deg), tuning.dt_s


@lean_kernel
def apply_right_of_way(i: int, scene: Scene) -> None:
    """Replace boat i's nominal command if it has been kept from turning for long enough."""
    state, tuning, memory = scene.state, scene.tuning, scene.memory
    speed_mps, turn_deg = scene.command[i, 0], wrap_degrees(scene.command[i, 1])
    if memory[i, W.GIVES_WAY] != 0.0 and not _goes_on(i, turn_deg, speed_mps, scene):
        memory[i, W.GIVES_WAY], memory[i, W.DEADLOCK_S] = 0.0, 0.0
    if memory[i, W.GIVES_WAY] != 0.0:
        memory[i, W.DEADLOCK_S] += tuning.dt_s
    else:
        _press(i, turn_deg, speed_mps, scene)
        if memory[i, W.GIVES_WAY] == 0.0 and memory[i, W.DEADLOCK_S] < tuning.deadlock_timeout_s:
            return
    if memory[i, W.GIVES_WAY] == GOES_ROUND:
        j = int(memory[i, W.BLOCKED_BY])
        bearing = math.atan2(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
        scene.command[i, 1] = wrap_degrees(math.degrees(bearing) + ROUND_DEG - state[i, L.HEADING])
        if abs(scene.command[i, 1]) > ON_COURSE_DEG and not _needs_way(scene.boats.params[i]):
            scene.command[i, 0] = 0.0
    else:
        scene.command[i, 1] = AWAY_DEG * memory[i, W.GIVES_WAY]
    scene.reason[i] = W.RIGHT_OF_WAY


@lean_kernel
def forget_deadlock(i: int, scene: Scene) -> None:
    """Note that nobody keeps boat i from turning, and that it gives way to nobody."""
    memory = scene.memory
    memory[i, W.GIVES_WAY], memory[i, W.DEADLOCK_S], memory[i, W.BLOCKED_BY] = 0.0, 0.0, -1


@lean_kernel
def note_deadlock(i: int, scene: Scene) -> None:
    """Note since when, and on what heading, boat i is kept from turning: its turn towards a teammate was changed."""
    state, tuning, memory = scene.state, scene.tuning, scene.memory
    if scene.reason[i] == W.RIGHT_OF_WAY:
        scene.active[i], memory[i, W.FREE_S] = int(memory[i, W.BLOCKED_BY]), 0.0
        return
    memory[i, W.FREE_S] += tuning.dt_s
    j = scene.active[i]
    if scene.reason[i] < W.LEAST_CHANGE or scene.reason[i] > W.BEST_EFFORT or j < 0 or unchanged(i, scene):
        return
    turn_deg, speed_mps = wrap_degrees(scene.checked[i, 1]), scene.checked[i, 0]
    stands = _stands(i, speed_mps, scene) and scene.ours[j]
    if not stands and _alongside(i, turn_deg, speed_mps, scene) != j:
        return
    memory[i, W.FREE_S] = 0.0
    if memory[i, W.DEADLOCK_S] == 0.0:
        if stands:
            memory[i, W.BLOCKED_BY] = j
        memory[i, W.DEADLOCK_S] = tuning.dt_s
        memory[i, W.DEADLOCK_DEG] = state[i, L.HEADING]
