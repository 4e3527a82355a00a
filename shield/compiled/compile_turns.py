"""Turns at compiling: what one process compiles, others that share the cache wait for instead of compiling it, too.

A turn is an advisory lock on a file beside the kept code. The system gives it back when its holder dies. Nothing
hangs on it: where there are no such locks, or the wait gets long, a function is compiled twice, which costs time only.
Callees are compiled within their caller's turn and never call back, so nobody waits in a circle.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Hashable
from pathlib import Path

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

LONGEST_WAIT_S = 300.0
_POLL_S = 0.02


class Turns:
    """The turns this process holds for one function.

    Args:
        path: where the lock files go, less their endings; None: nothing is kept, and nobody waits.
    """

    def __init__(self, path: str | None) -> None:
        self._path = path
        self._held: dict[Hashable, tuple[int, str]] = {}
        """Open files, by number: what a compilation that failed leaves open is closed with the process."""

    def take(self, key: Hashable) -> None:
        """Wait until nobody else compiles the function for ``key``, a signature; look again for its code then."""
        if self._path is None or fcntl is None or key in self._held:
            return
        path = f"{self._path}.{hashlib.sha256(str(key).encode()).hexdigest()[:12]}.lock"
        try:
            file = os.open(path, os.O_CREAT | os.O_WRONLY, 0o600)
        except OSError:
            return
        if _locked(file):
            self._held[key] = file, path
        else:
            os.close(file)

    def give(self, key: Hashable) -> None:
        """Let the next one go on."""
        if key not in self._held:
            return
        file, path = self._held.pop(key)
        Path(path).unlink(missing_ok=True)
        fcntl.flock(file, fcntl.LOCK_UN)  # a forked child has the file, too: closing ours alone would not do
        os.close(file)


def _locked(file: int) -> bool:
    """Whether the lock was got in time."""
    until = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < until:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_POLL_S)
        except OSError:  # a file system without locks
            return False
        else:
            return True
    return False
