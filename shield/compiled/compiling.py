"""Who is told that functions are being compiled: that takes a minute or two once, and must not look like hanging."""

from __future__ import annotations

import logging
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

LOG = logging.getLogger(__name__)
PATIENCE_S = 1.5
"""Compiling that takes no longer is not spoken of."""


class Listener(Protocol):
    """What is told of compiling, once it has taken more than `PATIENCE_S`."""

    def goes_on(self, done: int, of: int) -> None:
        """``done`` of ``of`` functions have machine code; not all of them need be used."""

    def ends(self) -> None:
        """The function that was asked for and all it calls are compiled; another may follow."""


class Compiling:
    """What is compiled in this process: how many functions there are, and which are being worked on."""

    def __init__(self) -> None:
        self._open: list[str] = []
        self._ready: set[str] = set()
        self._known: set[str] = set()
        self._made: set[str] = set()
        self._said = False
        self._started_s = self._spent_s = 0.0
        self.listener: Listener | None = None

    def knows(self, name: str) -> None:
        """There is such a function."""
        self._known.add(name)

    def loaded(self, name: str) -> None:
        """A function's machine code was found."""
        self._ready.add(name)

    def begins(self, name: str) -> None:
        """A function is compiled, and all it calls before `ended` is."""
        if not self._open:
            self._started_s = time.monotonic()
        self._open.append(name)
        self._tell()

    def ended(self, name: str) -> None:
        """A function that `begins` named is ready; those it called and that failed are forgotten."""
        self._ready.add(name)
        self._made.add(name)
        if name in self._open:
            del self._open[self._open.index(name) :]
        if not self._open:
            self._spent_s += time.monotonic() - self._started_s
        self._tell()
        if not self._open and self.listener is not None and self._said:
            self.listener.ends()

    @property
    def count(self) -> int:
        """How many functions have machine code."""
        return len(self._ready)

    @property
    def compiled(self) -> int:
        """How many of them were compiled in this process."""
        return len(self._made)

    @property
    def busy_s(self) -> float:
        """Time spent on compiling, s."""
        return self._spent_s + (time.monotonic() - self._started_s if self._open else 0.0)

    def _tell(self) -> None:
        if self.busy_s < PATIENCE_S or multiprocessing.parent_process() is not None:
            return  # workers are spoken of by those who started them
        if self.listener is not None:
            self.listener.goes_on(len(self._ready), len(self._known | self._ready))
        elif not self._said:
            LOG.warning(
                "steerclear compiles its machine code: a minute or two, once (steerclear warm-up does it beforehand)"
            )
        self._said = True


COMPILING = Compiling()
"""Of this process."""


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Let a listener hear of compiling, in place of one line in the log, as long as the block runs."""
    before, COMPILING.listener = COMPILING.listener, listener
    try:
        yield
    finally:
        COMPILING.listener = before
