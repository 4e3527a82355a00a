"""What the system says about processes (Linux' /proc; nothing where there is none), and ending them."""

from __future__ import annotations

import contextlib
import os
import signal
import time

_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096
MOST = 4096
"""Descendants that are listed at most."""


def children(pid: int) -> list[int]:
    """Processes that a process is the parent of."""
    found: list[int] = []
    with contextlib.suppress(OSError, ValueError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            found += map(int, _read(f"/proc/{pid}/task/{thread}/children").split())
    return found


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they did, itself not."""
    found: list[int] = []
    waiting = children(pid)
    while waiting and len(found) < MOST:
        one = waiting.pop()
        found.append(one)
        waiting += children(one)
    return found


def memory_bytes(pid: int) -> int:
    """Memory a process holds; 0 when it is gone."""
    words = _read(f"/proc/{pid}/statm").split()
    return int(words[1]) * _PAGE if len(words) > 1 else 0


def written_bytes(pid: int) -> int:
    """All that a process, and those it waited for, wrote so far; 0 when it is gone."""
    for line in _read(f"/proc/{pid}/io").splitlines():
        if line.startswith("wchar:"):
            return int(line.removeprefix("wchar:"))
    return 0


def is_stopped(pid: int) -> bool:
    """Whether a process was told to stop (SIGSTOP and its like), and has not gone on since."""
    return _read(f"/proc/{pid}/stat").rpartition(")")[2].split()[:1] in (["T"], ["t"])


def end_group(pid: int) -> None:
    """End at once all processes of a group that was started as one of its own."""
    with contextlib.suppress(ProcessLookupError, PermissionError, AttributeError):
        os.killpg(pid, signal.SIGKILL)


def end_children(patience_s: float = 2.0) -> None:
    """End this process's children, and what becomes its child thereby, until there is none."""
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        for pid in children(os.getpid()):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(0.001)


def end_marked(mark: str, patience_s: float = 2.0) -> None:
    """End all processes that were started with ``NAME=mark`` in their environment, and what they start meanwhile.

    It finds those that nobody is the parent of any more; forked ones keep the environment they were started with.
    """
    end_s = time.monotonic() + patience_s
    while (found := _marked(f"={mark}\0".encode())) and time.monotonic() < end_s:
        for pid in found:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.001)


def _marked(mark: bytes) -> list[int]:
    """Other processes that live and have a setting of this value; those that ended and wait for a parent have none."""
    found = []
    with contextlib.suppress(OSError):
        for pid in [int(name) for name in os.listdir("/proc") if name.isdigit()]:
            with contextlib.suppress(OSError), open(f"/proc/{pid}/environ", "rb") as file:
                if pid != os.getpid() and mark in file.read():
                    found.append(pid)
    return found


def _read(path: str) -> str:
    try:
        with open(path) as file:
            return file.read()
    except (OSError, UnicodeDecodeError):
        return ""
