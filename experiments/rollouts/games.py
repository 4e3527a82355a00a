"""Either filter for every game of a batch. Compiled."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray

from ..jit import kernel
from .gatekeeper import PASSED
from .gatekeeper import decide_game as decide_gatekeeper
from .paths import Setup
from .plcbf import decide_game as decide_library


@kernel
def decide_games(
    setup: Setup,
    by_library: bool,
    state: Array,
    wanted: Array,
    ours: BoolArray,
    plan: Array,
    sent: Array,
    reason: IntArray,
    clear_m: Array,
) -> None:
    """Decide by PL-CBF or by gatekeeper; arrays carry a leading games axis."""
    sent[:], reason[:], clear_m[:] = wanted, PASSED, np.inf
    for b in range(state.shape[0]):
        if by_library:
            decide_library(setup, state[b], ours[b], plan[b], sent[b], reason[b], clear_m[b])
        else:
            decide_gatekeeper(setup, state[b], ours[b], plan[b], sent[b], reason[b], clear_m[b])
