"""Our own process between a runner and foreign code, which it forks, watches and ends with all it started.

Its arguments (of `main`) are READ_FD WRITE_FD NOTE_FD FOLDER LIMITS PART PRELOAD...: module PART
has ``serve(read_fd, write_fd, folder)``, whose return value is the exit status. When that is `AGAIN`, all that is left
of it is ended and it begins anew, from a process that has everything imported; any other end is the keeper's, too. When
the runner is gone, so is everything here. NOTE_FD is the keeper's alone: it says `READY` when it begins anew, and which
limit was exceeded.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import select
import shutil
import signal
import sys
import traceback
from pathlib import Path
from typing import Any

from .limits import Limits, adopt_orphans, confine, end_with
from .system import end_children, end_group

AGAIN = 77
"""Exit status of foreign code's process that is done and may be followed by another."""
OVER = 78
"""The keeper's own, when it ended the code because of a limit."""
READY = "ready\n"
ALONE = "STEERCLEAR_ENTRY_ALONE"
"""Tells a submission's loader that the process is the submission's, see `policies.submissions.loader`."""
LOOK_S = 0.1
"""How often limits are looked at, s."""


class Keeper:
    """Forks foreign code and watches it.

    Args:
        fds: where orders come from, where answers go to, and where the keeper's notes do.
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
            end_children()
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
                end_with(own)
                os.close(self._note_fd)
                confine(self._limits)
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


def _as_own(status: int) -> int:
    """Exit status of a wait status; where a signal ended the code, it ends this process likewise."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        with contextlib.suppress(OSError, ValueError):
            signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    return os.WEXITSTATUS(status)


def main(arguments: list[str]) -> int:
    """Import what the code will need, then keep it."""
    read_fd, write_fd, note_fd = map(int, arguments[:3])
    folder, limits, part, *preload = arguments[3:]
    keeper = Keeper((read_fd, write_fd, note_fd), folder, Limits(**json.loads(limits)), part)
    for name in preload:
        with contextlib.suppress(Exception):  # the code itself will meet it
            importlib.import_module(name)
    adopt_orphans()
    os.environ[ALONE] = "1"
    with contextlib.suppress(ImportError, AttributeError, ValueError, OSError):
        resource: Any = importlib.import_module("resource")
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    gc.freeze()
    return keeper.run()
