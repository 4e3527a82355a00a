"""For how long an opponent may do its worst against a boat: as it is feared, and longer while the boat is slow.

What V(x, T) promises holds when the opponent's time T ends; a boat that gets away within that time is as safe as one
against which the opponent may do its worst for ever. A boat that has yet to gain speed does not: it would begin to fear
one that comes for it when it is too late to get going. So T counts from when the boat is under way, which nimble boats
are at once. Value tables hold V for T up to 20 s and for the whole play, and what is between is interpolated.
"""

from __future__ import annotations

from ..jit import lean_kernel
from ..platforms import layout as L
from ..scene import Boats
from ..work import Work

UNDER_WAY = 1.0 / 3.0
"""Share of its top speed at which a boat is under way."""


@lean_kernel
def feared_for(i: int, j: int, speed_mps: float, boats: Boats, work: Work) -> float:
    """Time, s, for which opponent j may do its worst against boat i at a speed; 0: it holds its course."""
    fear_s = work.fear_s[j]
    if fear_s <= 0.0:
        return 0.0
    return fear_s + max(0.0, UNDER_WAY - speed_mps / boats.params[i, L.MAX_SPEED]) * boats.regain_s[i]
