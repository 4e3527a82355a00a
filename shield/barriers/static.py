"""What of the static constraints concerns a boat on a manoeuvre, and when.

An obstacle stops a boat, and who is stopped is caught: one that is touched before a half turn could be over counts
before what pursuers may do. Later ones leave time for another manoeuvre, and count with what is kept by rule. So does
what a current may do by then: only its drift of a moment, which static constraints are widened by, comes before
pursuers.
"""

from __future__ import annotations

from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..scene import Boats, Scene
from .clearance import FAR, MARGIN
from .obstacles import clear_of_obstacles, grace
from .registered import clear_of_registered, way_out_of_registered
from .rules import clear_of_rules

STATIC = -2
"""In the place of the neighbour that binds: an obstacle, an edge or a circle does; below, registered barriers."""


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
def clear_of_static(i: int, slot: int, scene: Scene, out: Array) -> int:
    """Clearance row of boat i on the path in ``slot`` from obstacles and registered barriers at any time, and rules.

    ``work.spare2`` is overwritten. Returns what the least is from: `STATIC`, or below it the barrier, see `about`.
    """
    state, boats, static, work = scene.state, scene.boats, scene.static, scene.work
    path, way_m, last = work.path[slot], way_per_sample(i, state, boats), boats.samples[i]
    drift_m = static.current_mps * boats.sample_s
    near = boats.static_samples[i]
    clear_of_rules(state[i], path, near, last, static, way_m, drift_m, boats.sample_s, out)
    clear_of_obstacles(state[i], path, last, way_m, drift_m, grace(boats, static), static, FAR, work.spare2)
    if work.spare2[MARGIN] < out[MARGIN]:
        copy_row(out, work.spare2)
    barrier = clear_of_registered(i, slot, last, drift_m, scene, out)
    short_of = way_out_of_registered(i, slot, scene, out)
    return about(short_of if short_of >= 0 else barrier)


@lean_kernel
def clear_of_near_obstacles(i: int, slot: int, scene: Scene, most_m: float, out: Array) -> int:
    """The same from obstacles and registered barriers alone until a half turn could be over, ``most_m`` at most."""
    state, boats, static, work = scene.state, scene.boats, scene.static, scene.work
    path, way_m, last = work.path[slot], way_per_sample(i, state, boats), boats.static_samples[i]
    clear_of_obstacles(state[i], path, last, way_m, 0.0, grace(boats, static), static, most_m, out)
    return about(clear_of_registered(i, slot, last, 0.0, scene, out))
