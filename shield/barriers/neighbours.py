"""Which pairs of boats can matter to a decision, and what radius each has to keep."""

from __future__ import annotations

import math

from ..backup.effort import PATH_COST, PURSUER_COST
from ..jit import lean_kernel
from ..platforms import layout as L
from ..platforms.usv import next_thrust
from ..scene import Scene
from .foreseen import foresee, may_pursue
from .value_function import find_outnumbered, run_opponents

REGAIN_M = 0.01
"""A pair inside the buffer must part by at least this in the next step, m."""


@lean_kernel
def find_neighbours(scene: Scene) -> None:
    """Courses of all boats, and for each pair whether it can matter and which radius holds.

    A pair is left out when its distance exceeds R_ij + (fastest i + fastest j) * (longer horizon + tail). No boat ever
    exceeds its fastest speed, so on every path the certificate looks at the pair stays apart by more than R_ij: its
    margin is positive for every manoeuvre and every command, its row can never be the binding one, and leaving it
    out changes no decision.

    The radius is the separation with error margins and buffer. A pair already inside the buffer must come apart
    again; one inside the separation itself is in breach, see `_rank_recovery`.
    """
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    n = state.shape[0]
    work.spent[0], work.cut_short[0] = 0.0, False
    work.cost[:] = PATH_COST
    run_opponents(1, scene)
    foresee(scene)
    for i in range(n):
        work.pursued[i] = False
        work.reach_samples[i] = _reach_samples(i, scene)
        work.first_pursuer[i] = work.first_refuser[i] = 0
        work.first_manner[i, :] = 0
        heading = math.radians(state[i, L.HEADING])
        ux, uy = math.sin(heading), math.cos(heading)
        way = state[i, L.SPEED] * tuning.model_s
        work.course[i, 0], work.course[i, 1] = state[i, L.X] + way * ux, state[i, L.Y] + way * uy
        work.course[i, 2], work.course[i, 3] = ux, uy
        top_i = max(boats.fastest_mps[i], state[i, L.SPEED])
        for j in range(i):
            top = top_i + max(boats.fastest_mps[j], state[j, L.SPEED])
            samples = max(boats.samples[i], boats.samples[j])
            if boats.team[i] != boats.team[j]:
                reach_i = work.reach_samples[i] + boats.chase_samples[i, j]
                samples = max(samples, max(reach_i, work.reach_samples[j] + boats.chase_samples[j, i]))
            horizon_s = (samples + 1) * boats.sample_s + tuning.tail_s
            radius = tuning.radius_m + work.error_m[i] + work.error_m[j]
            dx, dy = state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y]
            square = dx * dx + dy * dy
            reach = radius + top * horizon_s
            hit = square <= reach * reach
            work.near[i, j], work.near[j, i] = hit, hit
            if hit:
                work.cost[i] += 1.0
                work.cost[j] += 1.0
                if boats.team[i] != boats.team[j]:
                    work.pursued[i] = work.pursued[i] or may_pursue(j, boats, work)
                    work.pursued[j] = work.pursued[j] or may_pursue(i, boats, work)
                    work.cost[i] += PURSUER_COST
                    work.cost[j] += PURSUER_COST
                least = radius - tuning.buffer_m
                now = math.sqrt(square)
                work.breach[i, j] = now < least
                work.breach[j, i] = now < least
                held = max(least, min(radius, now + REGAIN_M))
                work.radius[i, j], work.radius[j, i] = held, held
    find_outnumbered(scene)


@lean_kernel
def _reach_samples(i: int, scene: Scene) -> int:
    """Samples over which opponents of boat i may be followed.

    One whose thrust stays enough for the next step, whatever is commanded, is followed as boats are that have all of
    theirs; so is one that is not ours, whose manoeuvres nobody looks at.
    """
    state, ours, boats, tuning = scene.state, scene.ours, scene.boats, scene.tuning
    if not ours[i]:
        return boats.pursuit_samples[i]
    row = state[i]
    least, _, _ = next_thrust(
        boats.params[i], row[L.SPEED], row[L.THRUST], row[L.SPEED_ERROR], row[L.SPEED_INTEGRAL], 0.0, tuning.model_s
    )
    if boats.table_steps[i] == 0 and min(least, row[L.THRUST]) >= boats.ready_thrust[i]:
        return boats.pursuit_samples[i]
    return boats.pursuit_samples[i] + boats.thrust_samples[i]
