"""All entrants: ours, and those that entry points of other packages bring."""

from __future__ import annotations

from steerclear.shield.foreign import load_others

from . import alamer, chao, lucas, meo, ohto, options, undertow  # noqa: F401 (each enters its team)
from .catalogue import Entrant, entered
from .learned import entered as _learned  # noqa: F401 (each team with weights)

GROUP = "steerclear.entrants"
"""Entry points of this group name modules that hold ``@entrant`` classes."""


def entrants() -> dict[str, Entrant]:
    """All entrants, ours first, then those of other packages."""
    load_others(GROUP)
    return entered()
