"""How much a decision may cost: counted in work, not in seconds, so that the same inputs give the same bits anywhere.

The unit is the clearance of one path from one boat that holds its course, about a microsecond. A decision whose limit
is reached searches no further: every boat keeps the best manoeuvre it was found so far, at first the one it has held
since the last decision, and what is sent passes the same exact check as ever.
"""

from __future__ import annotations

from ..jit import lean_kernel
from ..scene import Tuning
from ..work import Work

PATH_COST = 2.0
"""Cost of tracing a path."""

PURSUER_COST = 5.0
"""Cost of running an opponent through as a pursuer, in every manner, or of looking it up."""

ROW_COST = 0.02
"""Cost of the program for each of its rows and boats."""


@lean_kernel
def all_spent(tuning: Tuning, work: Work) -> bool:
    """Whether the decision is to search no further; it is then told that it was cut short."""
    if work.spent[0] <= tuning.search_limit:
        return False
    work.cut_short[0] = True
    return True
