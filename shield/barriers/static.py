"""Barriers of static constraints and registered barriers, along the path of a manoeuvre.

Constraints are numbered. First come those that stop a boat: circles, walls, registered barriers. Then come the rules:
keep-out circles and the sides of the field. The number after the last stands for the field as a whole.

A stopped boat is caught. So an obstacle that is touched before a half turn could be over counts before pursuing
opponents. Later obstacles leave time for another manoeuvre; they count with the rules. The drift in a current of
unknown direction is split alike. Static constraints are widened by the drift of one moment, which counts before
pursuers. The drift that grows along a path counts with the rules.

Samples that cannot lower the clearance found so far are skipped: in m samples it shrinks by at most m times the boat's
way between samples, drift included. Registered barriers may move, so they are evaluated at every sample. Between two
samples a boat may cross a wall and be near it at neither. From there on it is behind the wall, by its distance from
it.

A boat beyond a rule must come back. No path satisfies the rule then, so paths are compared by where they lead: each is
continued straight on from its end. Paths that lead back score best, even if they lead farther out at first, because a
boat that lies still outside does not return. Among them, the one that leads out least is best.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..workspace import Scene, Static
from .clearance import FAR, MARGIN, lower
from .registered import LOST_M, margin_of

STATIC = -2
"""Active constraint: an obstacle, an edge or a circle. Lower numbers are registered barriers."""
SIDES = 4
"""Number of sides of a field; they have the last numbers."""
LEAVE_S = 0.5
"""Time constant with which a boat too near to an obstacle must move away where there may be a current, s."""
RETURN_S, RETURN_PARTS = 10.0, 5
"""For how long a path is continued straight on from its end, s, and in how many parts."""
HOME_M = 1.0
"""A continued path that gets this far inside leads back, m."""
FARTHEST_M = 100.0
"""Boats farther outside are treated as if at this distance, m: their paths differ by the same."""
RETURN_WORTH, DIP_WORTH = 0.01, 0.002
"""Penalties per metre, where a metre that the boat is outside now counts 1: ending short of home, and leading farther
out at first (5 m of that equal staying just outside)."""


class Sampling(NamedTuple):
    """How a path is sampled, and how far a boat gets from sample to sample."""

    near: int  # sample at which a half turn could be over
    side: int  # last sample at which the sides of the field are checked
    last: int  # last sample
    first_s: float  # time until the first sample, s
    sample_s: float  # time from sample to sample, s
    way_m: float  # most the boat moves through the water between samples, m
    drift_m: float  # most a current carries it between samples, m
    grace: float  # factor per sample on the excuse of a boat too near to an obstacle, see `_clearance`


@lean_kernel
def to_circle(x: float, y: float, circle: Array) -> tuple[float, float, float]:
    """Return the distance from a circle, m (negative inside), and its gradient, the unit vector away from it."""
    dx, dy = x - circle[0], y - circle[1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= 1e-9:
        return -circle[2], 1.0, 0.0
    return distance - circle[2], dx / distance, dy / distance


@lean_kernel
def to_wall(x: float, y: float, wall: Array, obstacle_clearance_m: float) -> tuple[float, float, float]:
    """Return the distance from a wall less the clearance, m, and its gradient, the unit vector away from it."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    length = dx * dx + dy * dy
    part = 0.0
    if length > 0.0:
        part = min(1.0, max(0.0, ((x - wall[0]) * dx + (y - wall[1]) * dy) / length))
    rx, ry = x - wall[0] - part * dx, y - wall[1] - part * dy
    distance = math.sqrt(rx * rx + ry * ry)
    if distance <= 1e-9:
        return -obstacle_clearance_m, 1.0, 0.0
    return distance - obstacle_clearance_m, rx / distance, ry / distance


@lean_kernel
def _side(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return on which side of the line from a to b a point is: positive left, negative right."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@lean_kernel
def goes_through(x0: float, y0: float, x1: float, y1: float, wall: Array) -> bool:
    """Return whether the way from one point to another crosses a wall."""
    ax, ay, bx, by = wall
    if (_side(x0, y0, ax, ay, bx, by) > 0.0) == (_side(x1, y1, ax, ay, bx, by) > 0.0):
        return False
    return (_side(ax, ay, x0, y0, x1, y1) > 0.0) != (_side(bx, by, x0, y0, x1, y1) > 0.0)


@lean_kernel
def to_rectangle(x: float, y: float, field: Array) -> tuple[float, float, float]:
    """Return how far inside a rectangle (left, low, right, high) a point is, m, and the gradient.

    Outside, it is minus the distance to the rectangle, and the gradient points there. Inside, the gradient is given as
    0.
    """
    dx = max(0.0, field[0] - x) - max(0.0, x - field[2])
    dy = max(0.0, field[1] - y) - max(0.0, y - field[3])
    outside_m = math.sqrt(dx * dx + dy * dy)
    if outside_m > 0.0:
        return -outside_m, dx / outside_m, dy / outside_m
    return min(min(x - field[0], field[2] - x), min(y - field[1], field[3] - y)), 0.0, 0.0


@lean_kernel
def to_side(x: float, y: float, side: int, field: Array) -> tuple[float, float, float]:
    """Return how far inside one side of a rectangle (left, low, right, high) a point is, m, and the gradient.

    Infinite where there is no edge.
    """
    at = x if side % 2 == 0 else y
    sign = 1.0 if side < 2 else -1.0
    inside_m = at - field[side] if side < 2 else field[side] - at
    return (inside_m, sign, 0.0) if side % 2 == 0 else (inside_m, 0.0, sign)


@lean_kernel
def about(barrier: int) -> int:
    """Return the active-constraint number of a registered barrier (-1: other static constraints); its own inverse."""
    return STATIC - 1 - barrier


@lean_kernel
def count_obstacles(static: Static) -> int:
    """Return the number of constraints that stop a boat."""
    return static.circles.shape[0] + static.segments.shape[0] + static.registered.address.shape[0]


@lean_kernel
def registered_number(o: int, static: Static) -> int:
    """Return which registered barrier constraint o is; -1 for none."""
    b = o - static.circles.shape[0] - static.segments.shape[0]
    return b if 0 <= b < static.registered.address.shape[0] else -1


@lean_kernel
def margin_at(o: int, x: float, y: float, ahead_s: float, static: Static) -> tuple[float, float, float]:
    """Return the margin, m, of constraint o at a place, ``ahead_s`` from now, and its gradient.

    The gradient of registered barriers is returned as 0: `registered.write_slope` finds it only where it is needed.
    """
    circles, walls = static.circles.shape[0], static.segments.shape[0]
    if o < circles:
        return to_circle(x, y, static.circles[o])
    if o < circles + walls:
        return to_wall(x, y, static.segments[o - circles], static.segment_m)
    rule = o - count_obstacles(static)
    if rule < 0:
        return margin_of(o - circles - walls, x, y, ahead_s, static.registered), 0.0, 0.0
    if rule < static.keep_out.shape[0]:
        return to_circle(x, y, static.keep_out[rule])
    side = rule - static.keep_out.shape[0]
    return to_rectangle(x, y, static.field) if side == SIDES else to_side(x, y, side, static.field)


@lean_kernel
def _sampling(i: int, drift_m: float, scene: Scene) -> Sampling:
    """Return how paths of boat i are sampled.

    Sides of the field are checked along whole paths, except for a boat that may be pursued. Every long straight run
    ends beyond a side, and such a boat has none to spare. For it, sides count until a half turn could be over.

    Where there may be a current, the excuse of a boat too near to an obstacle shrinks along the path. If the boat only
    had to come no nearer, a current would carry it in a little in every step.
    """
    boats = scene.boats
    return Sampling(
        boats.static_samples[i],
        boats.static_samples[i] if scene.pursued[i] else boats.samples[i],
        boats.samples[i],
        scene.tuning.model_s,
        boats.sample_s,
        max(boats.fastest_mps[i], scene.state[i, L.SPEED]) * boats.sample_s,
        drift_m,
        math.exp(-boats.sample_s / LEAVE_S) if scene.static.current_mps > 0.0 else 1.0,
    )


@lean_kernel
def _clearance(
    o: int, now_m: float, last: int, here: Array, path: Array, sampling: Sampling, static: Static, out: Array
) -> bool:
    """Lower a clearance row to that from constraint o until sample ``last``; return whether it was lowered.

    A boat that is already too near to an obstacle must come no nearer: its clearance counts from its present one. With
    ``grace`` below 1 it must also move away: its present shortfall is excused less from sample to sample. Crossing a
    wall is not excused, unless it is unknown on which side of it the boat is.
    """
    drift_m, obstacle_clearance_m, wall = sampling.drift_m, static.segment_m, o - static.circles.shape[0]
    is_wall, moves = 0 <= wall < static.segments.shape[0], registered_number(o, static) >= 0
    excused = min(0.0, now_m)
    fall_m = sampling.way_m + drift_m - excused * (1.0 - sampling.grace)
    known = now_m + obstacle_clearance_m >= static.side_m
    lowered, behind, x, y, k = False, False, here[0], here[1], 0
    while k <= last:
        margin, nx, ny = margin_at(o, path[k, 0], path[k, 1], sampling.first_s + k * sampling.sample_s, static)
        near_m = margin + obstacle_clearance_m if is_wall else FAR  # a wall farther off is not crossed
        if is_wall and known and goes_through(x, y, path[k, 0], path[k, 1], static.segments[wall]):
            behind = not behind
        if behind:
            margin, nx, ny = -near_m - obstacle_clearance_m - k * drift_m, -nx, -ny
        elif excused < 0.0:
            margin -= excused * sampling.grace**k + k * drift_m
        else:
            margin -= k * drift_m
        lowered = lowered or margin < out[MARGIN]
        lower(out, margin, k, nx, ny)
        x, y = path[k, 0], path[k, 1]
        k += 1 if moves else max(1, int(min(margin - out[MARGIN], near_m) / fall_m))
    return lowered


@lean_kernel
def _clear_of_sides(here: Array, path: Array, sampling: Sampling, static: Static, out: Array) -> None:
    """Lower a clearance row to that from the sides of the field, except those that the boat is beyond."""
    for side in range(SIDES):
        margin_m, nx, ny = to_side(here[0], here[1], side, static.field)
        if margin_m < 0.0 or margin_m == math.inf:
            continue
        for k in range(sampling.side + 1):
            margin_m = to_side(path[k, 0], path[k, 1], side, static.field)[0] - k * sampling.drift_m
            lower(out, margin_m, k, nx, ny)


@lean_kernel
def _way_back(o: int, now_m: float, path: Array, sampling: Sampling, static: Static) -> float:
    """Return the clearance, m, negative, of a path of a boat that is beyond constraint o (``now_m`` < 0)."""
    last, first_s, least_m, most_m = sampling.last, sampling.first_s, FAR, -FAR
    for k in range(last + 1):
        at_s = first_s + k * sampling.sample_s
        least_m = min(least_m, margin_at(o, path[k, 0], path[k, 1], at_s, static)[0])
    x, y = path[last, 0], path[last, 1]
    dx, dy = x - path[last - 1, 0], y - path[last - 1, 1]
    for part in range(RETURN_PARTS + 1):
        on_s = RETURN_S * part / RETURN_PARTS
        after, at_s = on_s / sampling.sample_s, first_s + last * sampling.sample_s + on_s
        most_m = max(most_m, margin_at(o, x + after * dx, y + after * dy, at_s, static)[0])
    farther_m = max(0.0, -now_m - FARTHEST_M)
    short_m = max(0.0, HOME_M - most_m - farther_m)
    return now_m + farther_m - RETURN_WORTH * short_m - DIP_WORTH * max(0.0, now_m - least_m)


@lean_kernel
def clear_of_constraints(
    near_only: bool, here: Array, path: Array, sampling: Sampling, static: Static, out: Array
) -> int:
    """Lower a clearance row to the least from all constraints, or from those that stop a boat and are near in time.

    For a boat beyond a rule the row tells how well the path leads back. The field counts as a whole here: with each
    side alone, a boat beyond a corner would turn to and fro. For a keep-out circle, the path's violation of other
    constraints is added; otherwise it would not count beside the boat's depth in the circle. A barrier that is unknown
    at the boat's place does not affect paths, see `registered.unknown_at`.

    Returns:
        The active constraint: `STATIC`, or below it a registered barrier, see `about`.
    """
    active, beyond, back_m = -1, -1, 0.0
    obstacles = count_obstacles(static)
    total = obstacles + static.keep_out.shape[0] + SIDES
    if not near_only:
        _clear_of_sides(here, path, sampling, static, out)
    for o in range(obstacles if near_only else total + 1):
        if total - SIDES <= o < total:
            continue
        now_m = margin_at(o, here[0], here[1], 0.0, static)[0]
        barrier = registered_number(o, static)
        if (barrier >= 0 and now_m <= LOST_M) or (o == total and now_m >= 0.0):
            continue
        if o >= obstacles and now_m < 0.0:
            score_m = _way_back(o, now_m, path, sampling, static)
            if score_m < back_m:
                beyond, back_m = o, score_m
            continue
        last = sampling.near if near_only else sampling.last
        if _clearance(o, now_m, last, here, path, sampling, static, out):
            active = barrier
    if beyond >= 0:
        if beyond < total - SIDES:
            back_m += min(0.0, out[MARGIN])
        if back_m < out[MARGIN]:
            _, nx, ny = margin_at(beyond, here[0], here[1], 0.0, static)
            lower(out, back_m, sampling.last, nx, ny)
            active = -1
    return about(active)


@lean_kernel
def clear_of_static(i: int, slot: int, scene: Scene, out: Array) -> int:
    """Find the clearance row of boat i on the path in ``slot`` from all static constraints and registered barriers.

    Returns the active constraint, see `clear_of_constraints`.
    """
    out[MARGIN] = FAR
    sampling = _sampling(i, scene.static.current_mps * scene.boats.sample_s, scene)
    return clear_of_constraints(False, scene.state[i], scene.path[slot], sampling, scene.static, out)


@lean_kernel
def clear_of_near_obstacles(i: int, slot: int, scene: Scene, most_m: float, out: Array) -> int:
    """Find the same from obstacles and registered barriers until a half turn could be over; at most ``most_m``."""
    out[MARGIN] = most_m
    return clear_of_constraints(True, scene.state[i], scene.path[slot], _sampling(i, 0.0, scene), scene.static, out)


@lean_kernel
def beyond_line(i: int, scene: Scene) -> bool:
    """Return whether boat i is beyond a hard line that stops boats."""
    return to_rectangle(scene.state[i, L.X], scene.state[i, L.Y], scene.static.line)[0] < 0.0
