"""What a process with foreign code may take, and how the system is made to see to it."""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import signal
import sys
from dataclasses import dataclass
from typing import Any

from . import system

GIB = 1024**3
_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36
"""Numbers of Linux' prctl."""


@dataclass(frozen=True)
class Limits:
    """Limits of one entry, over all processes it starts; one that goes beyond is ended, with them.

    Attributes:
        memory_bytes: memory; one process that asks for more gets a MemoryError.
        file_bytes: size of a file; writing more raises OSError.
        written_bytes: all it writes, to whatever files and pipes; None: no limit.
        output_bytes: what it prints; None: no limit.
        processes: processes at the same time, its own among them.
        files: files open in one process.
        gives_way: whether others go first on a busy machine.
    """

    memory_bytes: int = 4 * GIB
    file_bytes: int = GIB // 4
    written_bytes: int | None = GIB
    output_bytes: int | None = GIB // 16
    processes: int = 16
    files: int = 1024
    gives_way: bool = False

    def exceeded(self, keeper: int) -> str:
        """What the descendants of a process have too much of, in words; empty: nothing.

        Args:
            keeper: process whose descendants count, itself not.
        """
        found = system.descendants(keeper)
        if len(found) > self.processes:
            return f"it ran more than {self.processes} processes at a time"
        if sum(system.memory_bytes(pid) for pid in found) > self.memory_bytes:
            return f"it took more than {self.memory_bytes / GIB:g} GiB of memory"
        if self.written_bytes is not None and sum(map(system.written_bytes, found)) > self.written_bytes:
            return f"it wrote more than {self.written_bytes / GIB:g} GiB"
        return ""


def confine(limits: Limits) -> None:
    """Set this process's limits, for it and all it will start; what the system does not know is passed over.

    When memory runs out all the same, the system is told to end these processes first.
    """
    with contextlib.suppress(ImportError):
        resource: Any = importlib.import_module("resource")
        for name, value in (
            ("RLIMIT_DATA", limits.memory_bytes),
            ("RLIMIT_FSIZE", limits.file_bytes),
            ("RLIMIT_NOFILE", limits.files),
            ("RLIMIT_CORE", 0),
        ):
            with contextlib.suppress(AttributeError, ValueError, OSError):
                kind = getattr(resource, name)
                most = resource.getrlimit(kind)[1]
                allowed = value if most == resource.RLIM_INFINITY else min(value, most)
                resource.setrlimit(kind, (allowed, allowed))
    if limits.gives_way:
        with contextlib.suppress(OSError, AttributeError):
            os.nice(5)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:
        file.write("1000")


def end_with(parent: int) -> None:
    """Have the system end this process when the one that started it is gone, whatever this one is doing (Linux)."""
    _prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def adopt_orphans() -> None:
    """Have processes whose parent ended become children of this one, so that none gets away (Linux)."""
    _prctl(_SET_SUBREAPER, 1)


def unlimited() -> str:
    """What this system cannot limit, in words; empty: nothing."""
    if not hasattr(os, "fork"):
        return "entries cannot be run in a process of their own on this system: they run in this one, without limits"
    if not sys.platform.startswith("linux"):
        return "memory and number of processes of entries are not limited on this system"
    return ""


def _prctl(option: int, value: int) -> None:
    if sys.platform.startswith("linux"):
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
