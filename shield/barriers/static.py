"""What of the static constraints concerns a boat on a manoeuvre, and when.

An obstacle stops a boat, and who is stopped is caught: one that is touched before a half turn could be over counts
before what pursuers may do. Later ones leave time for another manoeuvre, and count with what is kept by rule. So does
what a current may do by then: only its drift of a moment, which static constraints are widened by, comes before
pursuers.

Samples of a path that cannot lower the clearance found so far are skipped: in m samples it shrinks by at most m times
the way the boat goes from sample to sample, its drift included. Registered barriers, which may move, are asked at
every one. What a current of unknown direction may do to a boat is a distance that grows with time: a clearance that is
to hold is that much larger.

Who goes through a wall is behind it from there on, by as much as it is off it: from sample to sample a boat may go from
before a wall to behind it, and be near it at neither.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..scene import Boats, Registered, Scene, Static
from .clearance import FAR, MARGIN, lower
from .constraints import SIDES, count_all, count_obstacles, margin_at, registered_number, wall_number
from .edge import to_side
from .registered import LOST_M
from .walls import goes_through
from .way_back import PARTS, RETURN_S, straight_on, worth_of_way_back

STATIC = -2
"""In the place of the neighbour that binds: an obstacle, an edge or a circle does; below, registered barriers."""

LEAVE_S = 0.5
"""Time constant with which a boat too near to an obstacle has to come away from it where there may be a current, s."""


class Sampling(NamedTuple):
    """How a path is sampled, and how far a boat gets from sample to sample.

    Attributes:
        near: sample at which a half turn could be over.
        side: last sample at which the sides of the field are looked at.
        last: last sample.
        first_s: time until the first sample, s.
        sample_s: time from sample to sample, s.
        way_m: most the boat moves through the water from sample to sample, m.
        drift_m: most a current carries it meanwhile, m.
        grace: factor per sample on what is excused of a boat that is too near to an obstacle, see `_clearance`.
    """

    near: int
    side: int
    last: int
    first_s: float
    sample_s: float
    way_m: float
    drift_m: float
    grace: float


@lean_kernel
def about(barrier: int) -> int:
    """What binds, in the place of a neighbour: the registered barrier of that number; -1: something else static.

    The same turns it back into the number.
    """
    return STATIC - 1 - barrier


@lean_kernel
def way_per_sample(i: int, state: Array, boats: Boats) -> float:
    """Most boat i moves through the water from sample to sample of a path, m."""
    return max(boats.fastest_mps[i], state[i, L.SPEED]) * boats.sample_s


@lean_kernel
def _sampling(i: int, drift_m: float, scene: Scene) -> Sampling:
    """How paths of boat i are sampled.

    Sides of the field are looked at to the end of them. Not by who may be pursued: every long straight run ends beyond
    a side, and of these it has none to spare; it looks until a half turn could be over, which is made when it is time.

    Where there may be a current less and less is excused: asked only to come no nearer than it is, a boat would be
    carried in a little in every step.
    """
    state, boats = scene.state, scene.boats
    return Sampling(
        boats.static_samples[i],
        boats.static_samples[i] if scene.work.pursued[i] else boats.samples[i],
        boats.samples[i],
        scene.tuning.model_s,
        boats.sample_s,
        way_per_sample(i, state, boats),
        drift_m,
        math.exp(-boats.sample_s / LEAVE_S) if scene.static.current_mps > 0.0 else 1.0,
    )


@lean_kernel
def _clearance(
    o: int,
    now_m: float,
    last: int,
    here: Array,
    path: Array,
    sampling: Sampling,
    static: Static,
    registered: Registered,
    out: Array,
) -> bool:
    """Lower a clearance row to that from constraint number o until sample ``last``; whether it was lower.

    A boat that is already too near to an obstacle has to come no nearer: its clearance there counts from where it is.
    With ``grace`` below 1 it has to come away as well: what it is short of now is excused less from sample to sample.
    Going through a wall is not excused, unless it is not known which side of it the boat is on.
    """
    drift_m, hull_m = sampling.drift_m, static.segment_m
    wall, moves = wall_number(o, static), registered_number(o, static, registered) >= 0
    excused = min(0.0, now_m)
    fall_m = sampling.way_m + drift_m - excused * (1.0 - sampling.grace)
    known = now_m + hull_m >= static.side_m
    lowered, behind, x, y, k = False, False, here[0], here[1], 0
    while k <= last:
        margin, nx, ny = margin_at(
            o, path[k, 0], path[k, 1], sampling.first_s + k * sampling.sample_s, static, registered
        )
        near_m = margin + hull_m if wall >= 0 else FAR  # a wall farther off is not gone through
        if wall >= 0 and known and goes_through(x, y, path[k, 0], path[k, 1], static.segments[wall]):
            behind = not behind
        if behind:
            margin, nx, ny = -near_m - hull_m - k * drift_m, -nx, -ny
        else:
            margin -= excused * sampling.grace**k + k * drift_m
        lowered = lowered or margin < out[MARGIN]
        lower(out, margin, k, nx, ny)
        x, y = path[k, 0], path[k, 1]
        k += 1 if moves else max(1, int(min(margin - out[MARGIN], near_m) / fall_m))
    return lowered


@lean_kernel
def _way_back(o: int, now_m: float, path: Array, sampling: Sampling, static: Static, registered: Registered) -> float:
    """What a path is worth, m, to a boat that is beyond constraint number o, see `way_back`."""
    last, first_s, least_m = sampling.last, sampling.first_s, FAR
    for k in range(last + 1):
        at_s = first_s + k * sampling.sample_s
        least_m = min(least_m, margin_at(o, path[k, 0], path[k, 1], at_s, static, registered)[0])
    most_m = -FAR
    for part in range(PARTS + 1):
        on_s = RETURN_S * part / PARTS
        x, y = straight_on(path, last, sampling.sample_s, on_s)
        at_s = first_s + last * sampling.sample_s + on_s
        most_m = max(most_m, margin_at(o, x, y, at_s, static, registered)[0])
    return worth_of_way_back(now_m, least_m, most_m)


@lean_kernel
def clear_of_constraints(
    near_only: bool, here: Array, path: Array, sampling: Sampling, static: Static, registered: Registered, out: Array
) -> int:
    """Lower a clearance row to the least from all constraints, or from those that stop a boat and are near in time.

    A boat that is beyond something kept by rule has to come back: what a path is worth as a way back is told. Of the
    field that is the way to all of it: of each side alone, a boat beyond a corner of it would turn to and fro. Of a
    keep-out circle that is less what the path would break of the rest, which else counted for nothing beside how deep
    the boat is in it. Paths say nothing of a barrier of which nothing is known where the boat is, see
    `registered.unknown_at`.

    Returns:
        What the least is from: `STATIC`, or below it the barrier, see `about`.
    """
    binds, beyond, back_m = -1, -1, 0.0
    obstacles, total = count_obstacles(static, registered), count_all(static, registered)
    for o in range(obstacles if near_only else total + 1):
        now_m = margin_at(o, here[0], here[1], 0.0, static, registered)[0]
        barrier = registered_number(o, static, registered)
        if barrier >= 0 and now_m <= LOST_M:
            continue
        side = total - SIDES <= o < total
        if o == total and now_m >= 0.0:
            continue
        if o >= obstacles and now_m < 0.0:
            if side:
                continue
            worth_m = _way_back(o, now_m, path, sampling, static, registered)
            if worth_m < back_m:
                beyond, back_m = o, worth_m
            continue
        last = sampling.near if near_only else (sampling.side if side else sampling.last)
        if _clearance(o, now_m, last, here, path, sampling, static, registered, out):
            binds = barrier
    if beyond >= 0:
        if beyond < total - SIDES:
            back_m += min(0.0, out[MARGIN])
        if back_m < out[MARGIN]:
            _, nx, ny = margin_at(beyond, here[0], here[1], 0.0, static, registered)
            lower(out, back_m, sampling.last, nx, ny)
            binds = -1
    return about(binds)


@lean_kernel
def clear_of_static(i: int, slot: int, scene: Scene, out: Array) -> int:
    """Clearance row of boat i on the path in ``slot`` from all static constraints and registered barriers.

    Returns what the least is from, see `clear_of_constraints`.
    """
    out[MARGIN] = FAR
    sampling = _sampling(i, scene.static.current_mps * scene.boats.sample_s, scene)
    here, path = scene.state[i], scene.work.path[slot]
    return clear_of_constraints(False, here, path, sampling, scene.static, scene.registered, out)


@lean_kernel
def clear_of_near_obstacles(i: int, slot: int, scene: Scene, most_m: float, out: Array) -> int:
    """The same from obstacles and registered barriers alone until a half turn could be over, ``most_m`` at most."""
    out[MARGIN] = most_m
    here, path = scene.state[i], scene.work.path[slot]
    return clear_of_constraints(True, here, path, _sampling(i, 0.0, scene), scene.static, scene.registered, out)


@lean_kernel
def beyond_line(i: int, scene: Scene) -> bool:
    """Whether boat i is beyond the hard line, and that stops boats."""
    x, y, line = scene.state[i, L.X], scene.state[i, L.Y], scene.static.line
    return min(to_side(x, y, 0, line)[0], to_side(x, y, 1, line)[0]) < 0.0 or (
        min(to_side(x, y, 2, line)[0], to_side(x, y, 3, line)[0]) < 0.0
    )
