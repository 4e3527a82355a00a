"""The supervisor between a runner and foreign code, which it forks, watches and ends with all it started.

What `main` is called with: READ_FD WRITE_FD NOTE_FD FOLDER LIMITS PART PRELOAD...: module PART has
``serve(read_fd, write_fd, folder)``, whose return value is the exit status. When that is `AGAIN`, all that is left of
it is ended and it begins anew, from a process that has everything imported; any other end is the supervisor's, too.
When the runner is gone, so is everything here. NOTE_FD is the supervisor's alone: it says `READY` when it begins anew,
and which limit was exceeded.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import json
import os
import select
import shutil
import signal
import sys
import time
import traceback
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

AGAIN = 77
"""Exit status of foreign code's process that is done and may be followed by another."""
OVER = 78
"""The supervisor's own, when it ended the code because of a limit."""
READY = "ready\n"
LOOK_S = 0.1
"""How often limits are looked at, s."""
GIB = 1024**3
MOST_DESCENDANTS = 4096
"""Descendants that are listed at most."""
_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36
"""Numbers of Linux' prctl,"""
_NEW_USER, _NEW_NETWORK = 0x10000000, 0x40000000
"""and flags of its unshare."""
_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


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
        network: whether it reaches the network; else only where the system cannot take that away, see `unlimited`.
    """

    memory_bytes: int = 4 * GIB
    file_bytes: int = GIB // 4
    written_bytes: int | None = GIB
    output_bytes: int | None = GIB // 16
    processes: int = 16
    files: int = 1024
    gives_way: bool = False
    network: bool = False

    def exceeded(self, supervisor: int) -> str:
        """What the descendants of a process have too much of, in words; empty: nothing."""
        found = descendants(supervisor)
        if len(found) > self.processes:
            return f"it ran more than {self.processes} processes at a time"
        if sum(map(_memory_bytes, found)) > self.memory_bytes:
            return f"it took more than {self.memory_bytes / GIB:g} GiB of memory"
        if self.written_bytes is not None and sum(map(_written_bytes, found)) > self.written_bytes:
            return f"it wrote more than {self.written_bytes / GIB:g} GiB"
        return ""

    def confine(self) -> None:
        """Set this process's limits, for it and all it will start; what the system does not know is passed over.

        When memory runs out all the same, the system is told to end these processes first.
        """
        _limit("RLIMIT_DATA", self.memory_bytes)
        _limit("RLIMIT_FSIZE", self.file_bytes)
        _limit("RLIMIT_NOFILE", self.files)
        _limit("RLIMIT_CORE", 0)
        if self.gives_way:
            with contextlib.suppress(OSError, AttributeError):
                os.nice(5)
        with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:
            file.write("1000")
        if not self.network:
            _leave_network()


def unlimited() -> str:
    """What this system cannot limit, in words; empty: nothing."""
    if not hasattr(os, "fork"):
        return "entries cannot be run in a process of their own on this system: they run in this one, without limits"
    if not sys.platform.startswith("linux"):
        return "memory, number of processes and network of entries are not limited on this system"
    return "" if _can_leave_network() else "this system lets nobody take the network from entries: they may reach it"


def _leave_network() -> bool:
    """Give this process, and all it will start, a network that leads nowhere (Linux); False: the system refuses.

    Who may not make one right away may as the root of a user namespace, which changes no right on files.
    """
    if not sys.platform.startswith("linux"):
        return False
    unshare = ctypes.CDLL(None).unshare
    return bool(unshare(_NEW_NETWORK) == 0 or unshare(_NEW_USER | _NEW_NETWORK) == 0)


@cache
def _can_leave_network() -> bool:
    """Whether it can be taken away: tried by a process that does nothing else."""
    pid = os.fork()
    if pid == 0:
        os._exit(0 if _leave_network() else 1)
    return os.waitpid(pid, 0)[1] == 0


class Supervisor:
    """Forks foreign code and watches it.

    Args:
        fds: where orders come from, where answers go to, and where the supervisor's notes do.
        folder: for temporary files; removed in the end.
        limits: of the code.
        part: name of the module that serves.
    """

    def __init__(self, fds: tuple[int, int, int], folder: str, limits: Limits, part: str) -> None:
        self._read_fd, self._write_fd, self._note_fd = fds
        self._folder, self._limits = folder, limits
        self._serve = importlib.import_module(part).serve

    def run(self) -> int:
        """Serve until the runner is gone or the code ends otherwise than with `AGAIN`; that exit status."""
        while True:
            pid = self._fork()
            status, why = self._watch(pid)
            if status is None:  # the folder goes first: when the code is gone, nothing is left
                shutil.rmtree(self._folder, ignore_errors=True)
            end_group(pid)
            _end_children()
            if status is None:
                shutil.rmtree(self._folder, ignore_errors=True)
                return 0
            if why:
                self._note(why)
                return OVER
            if status != AGAIN << 8:
                return _as_own(status)
            self._clear()
            self._note(READY)

    def _fork(self) -> int:
        own = os.getpid()
        pid = os.fork()
        if pid == 0:
            status: Any = 1
            try:
                os.setsid()
                self._limits.confine()
                _prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)  # ended with the supervisor, whatever it is doing
                if os.getppid() != own:
                    os._exit(1)
                os.close(self._note_fd)
                status = self._serve(self._read_fd, self._write_fd, self._folder)
            except BaseException:
                traceback.print_exc()
            finally:
                with contextlib.suppress(BaseException):
                    sys.stdout.flush()
                os._exit(status)
        return pid

    def _watch(self, pid: int) -> tuple[int | None, str]:
        """Wait for its end: wait status (None: the runner is gone) and the limit that ended it."""
        poll = select.poll()
        poll.register(self._read_fd, 0)  # told of the other end's closing only
        handle = os.pidfd_open(pid) if hasattr(os, "pidfd_open") else None
        if handle is not None:
            poll.register(handle, select.POLLIN)
        why = ""
        try:
            while True:
                done, status = os.waitpid(pid, os.WNOHANG)
                if done:
                    return status, why
                if any(descriptor == self._read_fd for descriptor, _ in poll.poll(1000 * LOOK_S)):
                    return None, ""
                if not why and (why := self._limits.exceeded(os.getpid())):
                    end_group(pid)
        finally:
            if handle is not None:
                os.close(handle)

    def _clear(self) -> None:
        for path in Path(self._folder).iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)

    def _note(self, text: str) -> None:
        with contextlib.suppress(OSError):
            os.write(self._note_fd, text.encode())


def main(arguments: list[str]) -> int:
    """Import what the code will need, then supervise it."""
    read_fd, write_fd, note_fd = map(int, arguments[:3])
    folder, limits, part, *preload = arguments[3:]
    supervisor = Supervisor((read_fd, write_fd, note_fd), folder, Limits(**json.loads(limits)), part)
    for name in preload:
        with contextlib.suppress(Exception):  # the code itself will meet it
            importlib.import_module(name)
    _prctl(_SET_SUBREAPER, 1)  # processes whose parent ended become this one's children, so that none gets away
    _limit("RLIMIT_CORE", 0)
    gc.freeze()
    return supervisor.run()


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they did, itself not (Linux)."""
    found: list[int] = []
    waiting = _children(pid)
    while waiting and len(found) < MOST_DESCENDANTS:
        one = waiting.pop()
        found.append(one)
        waiting += _children(one)
    return found


def is_stopped(pid: int) -> bool:
    """Whether a process was told to stop (SIGSTOP and its like), and has not gone on since."""
    return _read(f"/proc/{pid}/stat").rpartition(")")[2].split()[:1] in (["T"], ["t"])


def end_group(pid: int) -> None:
    """End at once all processes of a group that was started as one of its own."""
    with contextlib.suppress(ProcessLookupError, PermissionError, AttributeError):
        os.killpg(pid, signal.SIGKILL)


def end_marked(mark: str, patience_s: float = 2.0) -> None:
    """End all processes that were started with ``NAME=mark`` in their environment, and what they start meanwhile.

    It finds those that nobody is the parent of any more; forked ones keep the environment they were started with.
    """
    end_s = time.monotonic() + patience_s
    while (found := _marked(f"={mark}\0".encode())) and time.monotonic() < end_s:
        _kill(found)
        time.sleep(0.001)


def _end_children(patience_s: float = 2.0) -> None:
    """End this process's children, and what becomes its child thereby, until there is none."""
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        _kill(_children(os.getpid()))
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(0.001)


def _kill(pids: list[int]) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, signal.SIGKILL)


def _marked(mark: bytes) -> list[int]:
    """Other processes that live and have a setting of this value; those that ended and wait for a parent have none."""
    found = []
    with contextlib.suppress(OSError):
        for pid in [int(name) for name in os.listdir("/proc") if name.isdigit()]:
            with contextlib.suppress(OSError), open(f"/proc/{pid}/environ", "rb") as file:
                if pid != os.getpid() and mark in file.read():
                    found.append(pid)
    return found


def _children(pid: int) -> list[int]:
    found: list[int] = []
    with contextlib.suppress(OSError, ValueError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            found += map(int, _read(f"/proc/{pid}/task/{thread}/children").split())
    return found


def _memory_bytes(pid: int) -> int:
    """Memory a process holds; 0 when it is gone."""
    words = _read(f"/proc/{pid}/statm").split()
    return int(words[1]) * _PAGE if len(words) > 1 else 0


def _written_bytes(pid: int) -> int:
    """All that a process, and those it waited for, wrote so far; 0 when it is gone."""
    lines = (line for line in _read(f"/proc/{pid}/io").splitlines() if line.startswith("wchar:"))
    return int(next(lines, "wchar: 0").removeprefix("wchar:"))


def _read(path: str) -> str:
    try:
        with open(path) as file:
            return file.read()
    except (OSError, UnicodeDecodeError):
        return ""


def _limit(name: str, value: int) -> None:
    """Set one of the system's limits of a process, as far as it may be set."""
    with contextlib.suppress(ImportError, AttributeError, ValueError, OSError):
        resource: Any = importlib.import_module("resource")
        kind = getattr(resource, name)
        most = resource.getrlimit(kind)[1]
        allowed = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(kind, (allowed, allowed))


def _as_own(status: int) -> int:
    """Exit status of a wait status; where a signal ended the code, it ends this process likewise."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        with contextlib.suppress(OSError, ValueError):
            signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    return os.WEXITSTATUS(status)


def _prctl(option: int, value: int) -> None:
    if sys.platform.startswith("linux"):
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
