"""The competition's entrants by name: a decorator enters a team, an entry point of another package does too."""

from __future__ import annotations

import hashlib
import inspect
import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, TypeVar

from steerclear.shield.exceptions import PolicyError

GROUP = "steerclear.entrants"
"""Entry points of this group name modules that hold ``@entrant`` classes."""
Build = TypeVar("Build", bound=Callable[..., Any])
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Entrant:
    """A team of the competition.

    Attributes:
        name: how `steerclear.policies.make` and the command line know it.
        description: what it does, in a line.
        team: its name in the paper's tables; empty for newcomers.
        build: from options to a `TeamPolicy`.
    """

    name: str
    description: str
    team: str
    build: Callable[..., Any]

    def files(self) -> str:
        """Digest of the file that holds it; empty for ours, which the digest of the code covers."""
        if self.build.__module__.startswith("steerclear."):
            return ""
        source = inspect.getsourcefile(self.build)
        return "" if source is None else hashlib.sha256(Path(source).read_bytes()).hexdigest()[:16]


_ENTRANTS: dict[str, Entrant] = {}


def entrant(name: str, description: str, team: str = "") -> Callable[[Build], Build]:
    """Enter a team: put above a class, or a function that builds a `TeamPolicy`.

    Args:
        name: a new name, of letters, digits, ``_`` and ``-``.
        description: what it does, in a line.
        team: its name in the paper's tables.

    Raises:
        PolicyError: a name that is taken or that could be read as a path.
    """

    def enter(build: Build) -> Build:
        before = _ENTRANTS.get(name)
        if not name or not name.replace("_", "").replace("-", "").isalnum():
            raise PolicyError(f"an entrant cannot be named {name!r}; use letters, digits, _ and -")
        if before is not None and before.build.__qualname__ != build.__qualname__:
            raise PolicyError(
                f"there is an entrant {name!r} already ({before.build.__qualname__}); choose another name"
            )
        _ENTRANTS[name] = Entrant(name, description, team, build)
        return build

    return enter


def entrants() -> dict[str, Entrant]:
    """All entrants, ours first, then those of other packages."""
    _load_ours()
    _load_others()
    return dict(_ENTRANTS)


def _load_ours() -> None:
    from . import alamer, chao, lucas, meo, ohto, options  # noqa: F401 (each enters its team)
    from .learned import entered  # noqa: F401


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
