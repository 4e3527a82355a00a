"""The competition's entrants by name: a decorator registers a team, of ours or of another package."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import load_others

Build = TypeVar("Build", bound=Callable[..., Any])
GROUP = "steerclear.entrants"
"""Entry-point group of other packages: each entry names a module with ``@entrant`` classes."""


@dataclass(frozen=True)
class Entrant:
    """A team of the competition.

    Attributes:
        name: name for `steerclear.policies.make` and the command line.
        description: one line on what it does.
        team: its name in the paper's tables; empty for newcomers.
        build: from options to a `TeamPolicy`.
        batch: from the same options to a `BatchPolicy`; None if it plays single games only.
    """

    name: str
    description: str
    team: str
    build: Callable[..., Any]
    batch: Callable[..., Any] | None = None

    def files(self) -> str:
        """Return the fingerprint of its file; empty for ours, which the code's fingerprint covers."""
        source = None if self.build.__module__.startswith("steerclear.") else inspect.getsourcefile(self.build)
        return "" if source is None else hashlib.sha256(Path(source).read_bytes()).hexdigest()[:16]


_ENTRANTS: dict[str, Entrant] = {}
RESERVED: set[str] = set()
"""Names of other policies, which no entrant may have; `registry` fills it."""


def entrant(
    name: str, description: str, team: str = "", batch: Callable[..., Any] | None = None
) -> Callable[[Build], Build]:
    """Register a team: decorates a class, or a function that builds a `TeamPolicy`.

    Args:
        name: a new name, of letters, digits, ``_`` and ``-``.
        description: one line on what it does.
        team: its name in the paper's tables.
        batch: from the same options to a `BatchPolicy`, if it plays many games at once.

    Raises:
        PolicyError: the name is taken or could be read as a path, or the class is abstract.
    """

    def enter(build: Build) -> Build:
        before = _ENTRANTS.get(name)
        if not name or not name.replace("_", "").replace("-", "").isalnum():
            raise PolicyError(f"an entrant cannot be named {name!r}; use letters, digits, _ and -")
        if name in RESERVED:
            raise PolicyError(f"there is a policy {name!r} already; choose another name")
        if before is not None and before.build.__qualname__ != build.__qualname__:
            raise PolicyError(
                f"there is an entrant {name!r} already ({before.build.__qualname__}); choose another name"
            )
        if inspect.isabstract(build):
            missing = ", ".join(sorted(getattr(build, "__abstractmethods__", ())))
            raise PolicyError(f"entrant {name!r} cannot play; give its class: {missing}")
        _ENTRANTS[name] = Entrant(name, description, team, build, batch)
        return build

    return enter


def entrants() -> dict[str, Entrant]:
    """Return all entrants, ours first, then those of other packages."""
    load_others(GROUP)
    return dict(_ENTRANTS)
