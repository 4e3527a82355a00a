"""Registered barriers h(x, t), written by users and called by compiled code; like obstacles, they stop a boat.

A margin that is not a number counts as `LOST_M`: nothing is known there. Where the margin at the boat's own place is
unknown, the barrier does not affect paths and the boat is to stop, see `unknown_at`. Faults are counted and logged.
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
"""Margin, m, where a barrier gives no usable one."""
DEEPEST_M = -99.0
"""Lower margins count as this, m."""
STEEPEST = 10.0
"""Gradients beyond this, m per m, are not those of a distance."""


@lean_kernel
def _ask(b: int, x: float, y: float, ahead_s: float, part: int, registered: Registered) -> float:
    """Return the margin of barrier b (part 0) or its gradient along x or y (1, 2) at a place, ``ahead_s`` from now."""
    if registered.size[b] < 0:
        return math.nan
    ahead_s += registered.late_s
    return call(registered.address[b], x, y, ahead_s, registered.values[b], registered.size[b], part)


@lean_kernel
def margin_of(b: int, x: float, y: float, ahead_s: float, registered: Registered) -> float:
    """Return the margin of barrier b, m, less how far off a boat may be; `LOST_M` where there is none."""
    h = _ask(b, x, y, ahead_s, 0, registered)
    if math.isnan(h):
        registered.faults[b] += 1
        return LOST_M
    return max(DEEPEST_M, min(FAR, h - registered.uncertainty_m))


@lean_kernel
def unknown_at(i: int, scene: Scene) -> int:
    """Return the first barrier without a margin where boat i is, -1 for none; there no command can be checked."""
    state, registered = scene.state, scene.static.registered
    for b in range(registered.address.shape[0]):
        if margin_of(b, state[i, L.X], state[i, L.Y], 0.0, registered) <= LOST_M:
            return b
    return -1


@lean_kernel
def write_slope(b: int, i: int, slot: int, scene: Scene, out: Array) -> None:
    """Write the gradient of barrier b at the sample of a clearance row; 0 where there is none, or it is far too steep.

    It only helps the QP to propose a command: proposals are checked by margins.
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
    """The registered barriers of a shield, renewed before every decision.

    Args:
        names: their names.
        uncertainty_m: how far off a boat may be, and how much a margin may fall short between two samples of a path, m.
        late_s: time until the commands take effect, s.

    Raises:
        ConfigError: a name is not registered in this process, or the compiler rejects its function.
    """

    def __init__(self, names: tuple[str, ...], uncertainty_m: float, late_s: float) -> None:
        self.names, self.arrays = names, new_registered(len(names), uncertainty_m, late_s)
        for name in names:
            address_of(get_barrier(name))  # compiled now, not in the first decision

    def renew(self) -> None:
        """Write the barriers' present values and their addresses; a barrier that fails to give values is unknown."""
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
        """Log, once for each, the barriers that gave no usable margin in the last decision."""
        if not self.names:
            return
        for name, faults in zip(self.names, self.arrays.faults, strict=True):
            if faults:
                say_once(
                    f"margin of {name}",
                    f"barrier {name!r} gave no usable margin (faults in one decision: {faults}): NaN, an error, or a "
                    "slope beyond 10 m per m; boats keep out of there, and stop where it is so. Find out why by "
                    "check_barrier of steerclear.experiments.conformance",
                )
