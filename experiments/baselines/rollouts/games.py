"""Either filter for every game of a batch. Compiled."""

from __future__ import annotations

from ...jit import kernel
from ..batch_guard import Games
from .gatekeeper import decide_game as decide_gatekeeper
from .paths import Setup
from .plcbf import decide_game as decide_library


@kernel
def decide_games(setup: Setup, by_library: bool, games: Games) -> None:
    """Decide by PL-CBF or by gatekeeper; arrays carry a leading games axis, and the memory is the boats' plans."""
    state, _, ours, plan, sent, reason, clear_m = games
    for b in range(len(state)):
        if by_library:
            decide_library(setup, state[b], ours[b], plan[b], sent[b], reason[b], clear_m[b])
        else:
            decide_gatekeeper(setup, state[b], ours[b], plan[b], sent[b], reason[b], clear_m[b])
