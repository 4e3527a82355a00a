"""All entrants: ours, and those that entry points of other packages bring."""

from __future__ import annotations

import logging
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from . import alamer, chao, lucas, meo, ohto, options  # noqa: F401 (each enters its team)
from .catalogue import Entrant, entered
from .learned import entered as _learned  # noqa: F401 (each team with weights)

GROUP = "steerclear.entrants"
"""Entry points of this group name modules that hold ``@entrant`` classes."""
logger = logging.getLogger(__name__)


def entrants() -> dict[str, Entrant]:
    """All entrants, ours first, then those of other packages."""
    _load_others()
    return entered()


@cache
def _load_others() -> None:
    for point in entry_points(group=GROUP):
        _load(point)


def _load(point: EntryPoint) -> None:
    """Load another package's entrants; what is broken there is said and costs no one else theirs."""
    try:
        point.load()
    except Exception as error:  # another package may raise anything
        logger.warning("entrants of %s cannot be loaded: %s: %s", point.value, type(error).__name__, error)
