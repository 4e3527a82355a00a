"""Clearance on a path from registered barriers: they count as obstacles do, which stop a boat.

h(x, t) is asked at every sample of the path. A boat that is short of it now has to come no nearer, as from obstacles,
and is led out, see `way_back`.
What is no number counts as `LOST_M`: nobody knows what is there. Where nothing is known of the boat's own place, paths
say nothing of the barrier, and the boat is to stop, see `unknown_at`. How often that was so is noted, and said.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..scene import Registered, Scene
from .clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE, lower
from .obstacles import grace
from .pointer import call
from .way_back import RETURN_S, straight_on, worth_of_way_back

LOST_M = -100.0
"""Margin, m, where a barrier gives none that can be used."""

DEEPEST_M = -99.0
"""Margins below this count as it, m."""

STEEPEST = 10.0
"""Slopes beyond this, m per m, are no distance's."""


@lean_kernel
def _ask(b: int, x: float, y: float, ahead_s: float, part: int, registered: Registered) -> float:
    """Margin of barrier b (part 0), or its slope along x or y (1, 2), at a place so long from now."""
    if registered.size[b] < 0:
        return math.nan
    ahead_s += registered.late_s
    return call(registered.address[b], x, y, ahead_s, registered.values[b], registered.size[b], part)


@lean_kernel
def _margin(b: int, x: float, y: float, ahead_s: float, registered: Registered) -> float:
    """Margin of barrier b, m, less how far off a boat may be; `LOST_M` where there is none."""
    h = _ask(b, x, y, ahead_s, 0, registered)
    if math.isnan(h):
        registered.faults[b] += 1
        return LOST_M
    return max(DEEPEST_M, min(FAR, h - registered.off_m))


@lean_kernel
def unknown_at(i: int, scene: Scene) -> int:
    """First barrier that gives no margin where boat i is, -1 for none: what was wanted of it rests on nothing."""
    state, registered = scene.state, scene.registered
    for b in range(registered.address.shape[0]):
        if _margin(b, state[i, L.X], state[i, L.Y], 0.0, registered) <= LOST_M:
            return b
    return -1


@lean_kernel
def write_slope(b: int, i: int, slot: int, scene: Scene, out: Array) -> None:
    """Write the slope of barrier b at the sample of a clearance row; one that is none, or far too steep, as 0.

    It only helps the program to propose: what is proposed is checked by margins.
    """
    boats, tuning, registered, path = scene.boats, scene.tuning, scene.registered, scene.work.path[slot]
    k = int(out[SAMPLE])
    x, y, ahead_s = path[k, 0], path[k, 1], tuning.model_s + k * boats.sample_s
    nx, ny = _ask(b, x, y, ahead_s, 1, registered), _ask(b, x, y, ahead_s, 2, registered)
    if not nx * nx + ny * ny <= STEEPEST * STEEPEST:
        registered.faults[b] += 1
        nx, ny = 0.0, 0.0
    out[NORMAL_X], out[NORMAL_Y] = nx, ny


@lean_kernel
def clear_of_registered(i: int, slot: int, samples: int, drift_m: float, scene: Scene, out: Array) -> int:
    """Lower a clearance row of boat i on the path in ``slot`` to that from registered barriers.

    Args:
        i: boat.
        slot: where its path is.
        samples: last sample.
        drift_m: most a current carries it from sample to sample, m.
        scene: the scene.
        out: clearance row; its normal is not written, see `write_slope`.

    Returns:
        Number of the barrier that lowered it, -1 for none.
    """
    state, boats, tuning, registered = scene.state, scene.boats, scene.tuning, scene.registered
    path, keeps, least = scene.work.path[slot], grace(boats, scene.static), -1
    for b in range(registered.address.shape[0]):
        now_m = _margin(b, state[i, L.X], state[i, L.Y], 0.0, registered)
        if now_m <= LOST_M:
            continue
        excused = min(0.0, now_m)
        for k in range(samples + 1):
            margin = _margin(b, path[k, 0], path[k, 1], tuning.model_s + k * boats.sample_s, registered)
            margin -= excused * keeps**k + k * drift_m
            if margin < out[MARGIN]:
                lower(out, margin, k, 0.0, 0.0)
                least = b
    return least


@lean_kernel
def way_out_of_registered(i: int, slot: int, scene: Scene, out: Array) -> int:
    """Lower a clearance row of boat i to the worth of the path in ``slot`` as a way out of barriers it is short of.

    Returns the last one that lowered it, -1 for none.
    """
    state, boats, tuning, registered = scene.state, scene.boats, scene.tuning, scene.registered
    path, last, least = scene.work.path[slot], boats.samples[i], -1
    for b in range(registered.address.shape[0]):
        now_m = _margin(b, state[i, L.X], state[i, L.Y], 0.0, registered)
        if now_m >= 0.0 or now_m <= LOST_M:
            continue
        least_m = FAR
        for k in range(last + 1):
            ahead_s = tuning.model_s + k * boats.sample_s
            least_m = min(least_m, _margin(b, path[k, 0], path[k, 1], ahead_s, registered))
        x, y = straight_on(path, last, boats.sample_s)
        end_m = _margin(b, x, y, tuning.model_s + last * boats.sample_s + RETURN_S, registered)
        worth_m = worth_of_way_back(now_m, least_m, end_m)
        if worth_m < out[MARGIN]:
            lower(out, worth_m, last, 0.0, 0.0)
            least = b
    return least
