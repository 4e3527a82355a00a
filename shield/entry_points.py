"""What other packages bring by their entry points: loaded once, and what is broken costs nobody else theirs."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Any

LOG = logging.getLogger(__name__)


@cache
def load_others(group: str, register: Callable[[Any], Any] | None = None) -> None:
    """Load what entry points of a group name, once in a process; a module registers what it has itself.

    Args:
        group: of the entry points; its last word names what they bring.
        register: takes what is no module; None: nothing is to be done with it.
    """
    for point in entry_points(group=group):
        _load(point, group.rpartition(".")[2], register)


def _load(point: EntryPoint, what: str, register: Callable[[Any], Any] | None) -> None:
    try:
        found = point.load()
        if register is not None and not isinstance(found, ModuleType):
            register(found)
    except Exception as error:  # another package may raise anything
        LOG.warning("%s of %s cannot be loaded: %s: %s", what, point.value, type(error).__name__, error)
