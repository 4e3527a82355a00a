"""Registered barriers h(x, t): they count as obstacles do, which stop a boat.

What is no number counts as `LOST_M`: nobody knows what is there. Where nothing is known of the boat's own place, paths
say nothing of the barrier, and the boat is to stop, see `unknown_at`. How often that was so is noted, and said.
"""

from __future__ import annotations

import math

from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..scene import Registered, Scene
from .clearance import FAR, NORMAL_X, NORMAL_Y, SAMPLE
from .pointer import call

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
def margin_of(b: int, x: float, y: float, ahead_s: float, registered: Registered) -> float:
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
        if margin_of(b, state[i, L.X], state[i, L.Y], 0.0, registered) <= LOST_M:
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
