"""One process at a time writes results into a folder."""

from __future__ import annotations

import importlib
import os
import threading
import weakref
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

LOCK_FILE = ".lock"
_HELD: weakref.WeakValueDictionary[Path, FolderLock] = weakref.WeakValueDictionary()


class FolderLock:
    """A folder that is this process's alone while the object lives; get one with `lock_folder`.

    The system holds the lock and drops it with the process, however that ends, so that none is ever left over.

    Args:
        folder: exists.

    Raises:
        ConfigError: another process writes there.
        OSError: no file can be made there.
    """

    def __init__(self, folder: Path) -> None:
        self.writing = threading.Lock()
        """Held by the thread that writes."""
        path = folder / LOCK_FILE
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _try_lock(descriptor):
                raise ConfigError(
                    f"{folder} is being written to by {_holder(path)}; wait until it is done or choose another --out"
                )
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0) if hasattr(os, "pwrite") else None
        except BaseException:
            os.close(descriptor)
            raise
        weakref.finalize(self, os.close, descriptor)


def lock_folder(folder: Path) -> FolderLock:
    """The lock of a folder; several users in one process share it.

    Raises:
        ConfigError: another process writes there.
        OSError: no file can be made there.
    """
    place = folder.resolve()
    lock = _HELD.get(place)
    if lock is None:
        lock = _HELD[place] = FolderLock(place)
    return lock


def _try_lock(descriptor: int) -> bool:
    """Whether the lock is ours now; also where the system or the disk has none, and nobody could be kept out."""
    fcntl: Any = _module("fcntl")
    msvcrt: Any = _module("msvcrt")
    try:
        if fcntl is not None:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:  # a network disk without locks
        return True
    return True


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def _holder(path: Path) -> str:
    try:
        return f"process {int(path.read_text()[:20])}"
    except (OSError, ValueError):
        return "another process"
