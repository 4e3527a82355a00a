"""Clearance on a path from registered barriers: they count as obstacles do, which stop a boat.

h(x, t) is asked at every sample of the path. A boat that is short of it now has to come no nearer, as from obstacles.
What is no number, or steeper than any distance, counts as `LOST_M`: nobody knows what is there. How often that was so
is noted, and said.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..scene import Registered, Scene
from .clearance import FAR, MARGIN, NORMAL_X, NORMAL_Y, SAMPLE, lower
from .obstacles import grace
from .pointer import call

LOST_M = -100.0
"""Margin, m, where a barrier gives none that can be used."""

BEYOND_M = 50.0
"""Margins beyond this are not looked at closely, m: no step of a boat brings them down to what it keeps."""

STEEPEST = 10.0
"""Slopes beyond this, m per m, are no distance's: what is said of a sample then says nothing of the way to the next."""


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
    return max(LOST_M, min(FAR, h - registered.off_m))


@lean_kernel
def _excused(b: int, i: int, scene: Scene) -> float:
    """What boat i is short of barrier b now, m, <= 0; nothing where nothing is known of it."""
    h = _margin(b, scene.state[i, L.X], scene.state[i, L.Y], 0.0, scene.registered)
    return min(0.0, h) if h > LOST_M else 0.0


@lean_kernel
def _write_slope(b: int, x: float, y: float, ahead_s: float, registered: Registered, out: Array) -> None:
    """Write the slope of barrier b into a clearance row; one that is none, or far too steep, makes it `LOST_M`."""
    nx, ny = _ask(b, x, y, ahead_s, 1, registered), _ask(b, x, y, ahead_s, 2, registered)
    out[NORMAL_X], out[NORMAL_Y] = nx, ny
    if not nx * nx + ny * ny <= STEEPEST * STEEPEST:
        registered.faults[b] += 1
        out[MARGIN], out[NORMAL_X], out[NORMAL_Y] = LOST_M, 0.0, 0.0


@lean_kernel
def clear_of_registered(i: int, slot: int, samples: int, drift_m: float, scene: Scene, out: Array) -> int:
    """Lower a clearance row of boat i on the path in ``slot`` to that from registered barriers.

    Args:
        i: boat.
        slot: where its path is.
        samples: last sample.
        drift_m: most a current carries it from sample to sample, m.
        scene: the scene.
        out: clearance row; its normal is the slope of the barrier, m per m.

    Returns:
        Number of the barrier that lowered it, -1 for none.
    """
    boats, tuning, registered, path = scene.boats, scene.tuning, scene.registered, scene.work.path[slot]
    keeps, least = grace(boats, scene.static), -1
    for b in range(registered.address.shape[0]):
        excused = _excused(b, i, scene)
        for k in range(samples + 1):
            margin = _margin(b, path[k, 0], path[k, 1], tuning.model_s + k * boats.sample_s, registered)
            margin -= excused * keeps**k + k * drift_m
            if margin < out[MARGIN]:
                lower(out, margin, k, 0.0, 0.0)
                least = b
    if least >= 0 and out[MARGIN] < BEYOND_M:
        k = int(out[SAMPLE])
        _write_slope(least, path[k, 0], path[k, 1], tuning.model_s + k * boats.sample_s, registered, out)
    return least
