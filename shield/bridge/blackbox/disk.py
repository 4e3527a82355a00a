"""A file that grows, written without buffers of anybody else's, and what its failures mean to a person."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from ...exceptions import BridgeError

_MEANINGS = {
    errno.ENOSPC: ("the disk is full", "free space on it or set log_dir to another disk"),
    errno.EDQUOT: ("the disk quota is used up", "free space or set log_dir to another disk"),
    errno.EFBIG: ("the file may not grow any further", "raise the limit on file sizes or set log_dir to another disk"),
    errno.EROFS: ("the disk is read-only", "set log_dir to a disk that can be written"),
    errno.EACCES: ("writing there is not allowed", "set log_dir to a folder you may write to"),
    errno.EPERM: ("writing there is not allowed", "set log_dir to a folder you may write to"),
    errno.EIO: ("the disk fails", "set log_dir to another disk"),
    errno.EEXIST: ("the file exists already", "give a name that is not taken"),
    errno.ENOENT: ("the folder does not exist", "create it or set log_dir to another folder"),
    errno.ENOTDIR: ("the folder is a file", "set log_dir to a folder"),
}


def explain(error: OSError) -> str:
    """What an error of the file system means, and the remedy, in one line."""
    meaning, remedy = _MEANINGS.get(
        error.errno or 0, (f"writing failed ({error.strerror or error})", "set log_dir to another disk")
    )
    return f"{meaning}; {remedy}"


class Disk:
    """A new file. What is written is kept until `flush` hands it to the system and `sync` to the disk.

    Args:
        path: of the file; it must not exist, its folder is made.

    Raises:
        BridgeError: it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self._pending = bytearray()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise BridgeError(f"cannot begin the log {path}: {explain(error)}") from error

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Keep bytes for the next flush."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Bytes written so far, kept ones included."""
        return self.size + len(self._pending)

    def flush(self) -> None:
        """Hand everything kept to the system: from then on it outlives this process.

        Raises:
            OSError: the system does not take it all.
        """
        while self._pending:
            written = self.put(bytes(self._pending))
            del self._pending[:written]
            self.size += written

    def sync(self) -> None:
        """Wait until the disk has it: from then on it outlives a loss of power.

        Raises:
            OSError: the disk fails.
        """
        if self._file is not None:
            os.fsync(self._file)

    def put(self, data: bytes) -> int:
        """Write to the system; returns how many bytes it took.

        Raises:
            OSError: none.
        """
        if self._file is None:
            raise OSError(errno.EBADF, "the file is closed")
        return os.write(self._file, data)

    def close(self) -> None:
        """Give the file back; what was not flushed is dropped."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
