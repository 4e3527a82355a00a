"""What of the static constraints concerns a boat on a manoeuvre, and when.

An obstacle stops a boat, and who is stopped is caught: one that is touched before a half turn could be over counts
before what pursuers may do. Later ones leave time for another manoeuvre, and count with what is kept by rule. So does
what a current may do by then: only its drift of a moment, which static constraints are widened by, comes before
pursuers.
"""

from __future__ import annotations

import math

from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..scene import Boats, Scene, Static
from .clearance import MARGIN
from .obstacles import clear_of_obstacles, first_touch
from .rules import clear_of_rules

LEAVE_S = 0.5
"""Time constant with which a boat too near to an obstacle has to come away from it, s."""


@lean_kernel
def way_per_sample(i: int, state: Array, boats: Boats) -> float:
    """Most boat i moves through the water from sample to sample of a path, m."""
    return max(boats.fastest_mps[i], state[i, L.SPEED]) * boats.sample_s


@lean_kernel
def grace(boats: Boats, static: Static) -> float:
    """Factor per sample on what a boat too near to an obstacle is excused.

    Where there may be a current that is less than 1: asked only to come no nearer than it is, a boat would be carried
    in a little in every step.
    """
    return math.exp(-boats.sample_s / LEAVE_S) if static.current_mps > 0.0 else 1.0


@lean_kernel
def clear_of_static(i: int, slot: int, scene: Scene, out: Array) -> None:
    """Clearance row of boat i on the path in ``slot`` from obstacles at any time, field edge and keep-out circles.

    ``work.spare2`` is overwritten.
    """
    state, boats, static, work = scene.state, scene.boats, scene.static, scene.work
    path, way_m, last = work.path[slot], way_per_sample(i, state, boats), boats.samples[i]
    drift_m = static.current_mps * boats.sample_s
    near = boats.static_samples[i]
    clear_of_rules(state[i], path, near, last, static, way_m, drift_m, boats.sample_s, out)
    clear_of_obstacles(state[i], path, last, way_m, drift_m, grace(boats, static), static, work.spare2)
    if work.spare2[MARGIN] < out[MARGIN]:
        copy_row(out, work.spare2)


@lean_kernel
def clear_of_near_obstacles(i: int, slot: int, scene: Scene, out: Array) -> None:
    """The same from obstacles alone until a half turn could be over."""
    state, boats, static, work = scene.state, scene.boats, scene.static, scene.work
    path, way_m, last = work.path[slot], way_per_sample(i, state, boats), boats.static_samples[i]
    clear_of_obstacles(state[i], path, last, way_m, 0.0, grace(boats, static), static, out)


@lean_kernel
def share_before_touch(i: int, slot: int, scene: Scene) -> float:
    """Share of the time of a half turn after which boat i first touches an obstacle, 1 when it does not."""
    state, boats, static, work = scene.state, scene.boats, scene.static, scene.work
    last = boats.static_samples[i]
    way_m = way_per_sample(i, state, boats)
    first = first_touch(state[i], work.path[slot], last, way_m, 0.0, grace(boats, static), static)
    return first / (last + 1.0)
