"""Speeds that are sent are within what the platform does, whoever asked for more.

The cut comes before the decision: the model then predicts what the boat is really told. Games limit speeds themselves,
each in its own way (a thrust boat that is told more than its top speed gains thrust sooner), and play a command as it
is, shield or not: theirs pass bit for bit.
"""

from __future__ import annotations

import numpy as np

from ..commands import Commands
from ..fleet import Fleet
from ..hints import hint_at_speed
from ..jit import Array, BoolArray, IntArray
from ..plan import LARGEST_COMMAND, LIMITED, PASSED
from ..platforms import layout as L

ROUNDING_MPS = 1e-6
"""A speed beyond the limit by less is that limit, rounded: it passes as it is."""


def within_limits(wanted: Commands, fleet: Fleet, params: Array) -> tuple[Commands, BoolArray | None]:
    """Wanted commands of own boats, with speeds their platforms do, and (n,) which are cut, if any.

    No platform is sent astern: none has a speed below 0 in its model. What is no command at all
    (not finite, or beyond `LARGEST_COMMAND`) is left to the decision, which holds those boats.
    """
    if wanted.of_game or len(fleet) == 0:
        return wanted, None
    speed, highest = wanted.values[:, 0], params[:, L.MAX_SPEED]
    beyond = (speed > highest + ROUNDING_MPS) | (speed < -ROUNDING_MPS)
    cut: BoolArray = fleet.controlled & beyond & (np.abs(wanted.values) <= LARGEST_COMMAND).all(axis=1)
    if not cut.any():
        return wanted, None
    first = int(np.argmax(cut))
    hint_at_speed(fleet.names[first], float(speed[first]), float(highest[first]))
    return wanted.within(cut, highest), cut


def tell_of_limits(cut: BoolArray, changed: BoolArray, reason: IntArray) -> BoolArray:
    """Name the reason of commands that were cut and nothing else; returns (n,) which are not what was wanted."""
    reason[cut & (reason == PASSED)] = LIMITED
    return changed | cut
