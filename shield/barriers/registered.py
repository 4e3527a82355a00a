"""Registered barriers h(x, t): somebody else's, called by compiled code; they count as obstacles do, which stop a boat.

What is no number counts as `LOST_M`: nobody knows what is there. Where nothing is known of the boat's own place, paths
say nothing of the barrier, and the boat is to stop, see `unknown_at`. How often that was so is noted, and said.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import say_once
from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..workspace import Registered, Scene, new_registered
from .clearance import FAR, NORMAL_X, NORMAL_Y, SAMPLE
from .pointer import address_of, call
from .registry import get_barrier

LOST_M = -100.0
"""Margin, m, where a barrier gives none that can be used."""
DEEPEST_M = -99.0
"""Margins below this count as it, m."""
STEEPEST = 10.0
"""Gradients beyond this, m per m, are no distance's."""


@lean_kernel
def _ask(b: int, x: float, y: float, ahead_s: float, part: int, registered: Registered) -> float:
    """Margin of barrier b (part 0), or its gradient along x or y (1, 2), at a place so long from now."""
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
    """First barrier that gives no margin where boat i is, -1 for none: what was nominal for it rests on nothing."""
    state, registered = scene.state, scene.static.registered
    for b in range(registered.address.shape[0]):
        if margin_of(b, state[i, L.X], state[i, L.Y], 0.0, registered) <= LOST_M:
            return b
    return -1


@lean_kernel
def write_slope(b: int, i: int, slot: int, scene: Scene, out: Array) -> None:
    """Write the gradient of barrier b at the sample of a clearance row; one that is none, or far too steep, as 0.

    It only helps the program to propose: what is proposed is checked by margins.
    """
    registered, path = scene.static.registered, scene.path[slot]
    k = int(out[SAMPLE])
    x, y, ahead_s = path[k, 0], path[k, 1], scene.tuning.model_s + k * scene.boats.sample_s
    nx, ny = _ask(b, x, y, ahead_s, 1, registered), _ask(b, x, y, ahead_s, 2, registered)
    if not nx * nx + ny * ny <= STEEPEST * STEEPEST:
        registered.faults[b] += 1
        nx, ny = 0.0, 0.0
    out[NORMAL_X], out[NORMAL_Y] = nx, ny


class RegisteredBarriers:
    """The registered barriers that a shield keeps, renewed before every decision.

    Args:
        names: of them.
        off_m: how far off a boat may be, and how much a margin may fall short between two samples of a path, m.
        late_s: time until the moment that is decided for, s.

    Raises:
        ConfigError: there is none of that name in this process.
    """

    def __init__(self, names: tuple[str, ...], off_m: float, late_s: float) -> None:
        self.names, self.arrays = names, new_registered(len(names), off_m, late_s)
        for name in names:
            address_of(get_barrier(name))  # compiled now, not in the first decision

    def renew(self) -> None:
        """Write what the barriers are given now, and their addresses; of one that cannot say it, nothing is known."""
        arrays = self.arrays
        for b, name in enumerate(self.names):
            barrier = get_barrier(name)
            arrays.address[b], arrays.faults[b], arrays.values[b] = address_of(barrier), 0, np.nan
            try:
                values = barrier.now()
            except Exception as error:  # foreign code may raise anything
                say_once(f"values of {name}", f"barrier {name!r} counts as broken: it has no values now ({error})")
                arrays.size[b] = -1
            else:
                arrays.size[b] = len(values)
                arrays.values[b, : len(values)] = values

    def tell(self) -> None:
        """Log, once for each, which barriers gave no usable margin in the last decision."""
        if not self.names:
            return
        for name, faults in zip(self.names, self.arrays.faults, strict=True):
            if faults:
                say_once(
                    f"margin of {name}",
                    f"barrier {name!r} gave no usable margin ({faults} times in one decision): NaN, an error, or a "
                    "slope beyond 10 m per m; boats keep out of there, and stop where it is so. Find out why by "
                    "check_barrier of steerclear.experiments.conformance",
                )
