"""A file that grows, written by a thread of its own so that a slow disk delays nobody; packets' log; is there room."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import queue
import shutil
import struct
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

from ...exceptions import BridgeError
from ..preflight_checks import CheckResult

LOG = logging.getLogger(__name__)

LATE_S, TALK_EVERY_S = 1.0, 30.0  # a disk that is so much behind is told, s, and again after the other
PAUSE_S = 0.5
"""Of the time between two things handed over no more than this counts against the disk, s: whoever hands them over
stood still for the rest (a suspended process, say), and the thread may have, too."""
BYTES_PER_BOAT_S = 6_000.0  # generous size of the log per boat and second at 10 Hz: MCAP and tlog together
SLOWEST_SYNC_S = 0.5  # a disk that takes longer than this to keep a second of log cannot hold it at most 1 s behind
_CHUNK = 64 * 1024

Item = TypeVar("Item")


_ELSEWHERE = "set log_dir to another disk"
_MEANINGS = {
    errno.ENOSPC: ("the disk is full", f"free space on it or {_ELSEWHERE}"),
    errno.EDQUOT: ("the disk quota is used up", f"free space or {_ELSEWHERE}"),
    errno.EFBIG: ("the file may not grow any further", f"raise the limit on file sizes or {_ELSEWHERE}"),
    errno.EROFS: ("the disk is read-only", "set log_dir to a disk that can be written"),
    errno.EACCES: ("writing there is not allowed", "set log_dir to a folder you may write to"),
    errno.EPERM: ("writing there is not allowed", "set log_dir to a folder you may write to"),
    errno.EIO: ("the disk fails", _ELSEWHERE),
    errno.EEXIST: ("the file exists already", "give a name that is not taken"),
    errno.ENOENT: ("the folder does not exist", "create it or set log_dir to another folder"),
    errno.ENOTDIR: ("the folder is a file", "set log_dir to a folder"),
}


def make_folder(folder: Path) -> None:
    """Make a folder for logs, unless it is there.

    Raises:
        OSError: it cannot be made, see `explain`; `NotADirectoryError`: there is a file of that name.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder)) from None


def explain(error: OSError) -> str:
    """What an error of the file system means, and the remedy, in one line."""
    unknown = (f"writing failed ({error.strerror or error})", _ELSEWHERE)
    return "; ".join(_MEANINGS.get(error.errno or 0, unknown))


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
            make_folder(path.parent)
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


class Store(Generic[Item]):
    """What the writer's thread, and nobody else, does with things, and the file it keeps them in."""

    def __init__(self, disk: Disk) -> None:
        self.disk = disk

    def keep(self, item: Item) -> None:
        """Take one thing."""
        raise NotImplementedError

    def flush(self) -> None:
        """Bring what was taken to the disk."""
        self.disk.flush()
        self.disk.sync()

    def finish(self) -> None:
        """Complete and close the file."""
        self.disk.flush()
        self.disk.sync()
        self.disk.close()


class AsyncWriter(Generic[Item]):
    """Hands things to a thread that writes them.

    Args:
        name: of the log, for messages.
        store: writes them.
        capacity: things that may wait; more are dropped and counted.
        flush_s: longest time between flushes, s.
        give_up_s: when the disk has taken nothing for so long, s, `put` says so.

    Attributes:
        dropped: things that found no place.
        fault: why nothing is written any more; empty while all is well.
    """

    def __init__(
        self, name: str, store: Store[Item], *, capacity: int = 300, flush_s: float = 0.5, give_up_s: float = 10.0
    ) -> None:
        self.name, self.dropped, self.fault = name, 0, ""
        self._store, self._flush_s, self._give_up_s = store, flush_s, give_up_s
        self._queue: queue.Queue[tuple[float, Item] | None] = queue.Queue(capacity)
        self._oldest_s: float | None = None
        self._logged_s = -TALK_EVERY_S
        self._closing = threading.Event()
        self._handed = (0.0, time.monotonic())  # time that counts, and when it was so; one tuple for both threads
        self._progress_s = self._clock()
        self._thread = threading.Thread(target=self._run, name=f"log {name}", daemon=True)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Hand one thing over; never waits.

        Raises:
            BridgeError: nothing is written any more.
        """
        if self.fault or self._closing.is_set():
            raise BridgeError(self.fault or f"the log {self.name} is closed; open another one")
        active_s = self._clock()
        self._handed = (active_s, time.monotonic())
        try:
            self._queue.put_nowait((active_s, item))
        except queue.Full:
            if self.dropped == 0:
                LOG.warning(
                    "the log %s: the disk is too slow, %d entries wait, more are dropped", self.name, self.waiting
                )
            self.dropped += 1
        stuck_s = active_s - self._progress_s
        if stuck_s > self._give_up_s and self.waiting > 1:
            raise BridgeError(
                f"the log {self.name}: the disk has taken nothing for {stuck_s:.0f} s; check it or set log_dir to "
                "another disk"
            )

    def close(self, timeout_s: float = 10.0) -> None:
        """Write what waits, complete the file; waits at most that long. What went wrong is in ``fault``."""
        self._closing.set()
        with contextlib.suppress(queue.Full):  # wakes the thread; a full queue keeps it awake anyway
            self._queue.put_nowait(None)
        self._thread.join(timeout_s)
        if self._thread.is_alive() and not self.fault:
            self.fault = f"the log {self.name} could not be completed within {timeout_s:g} s; its end may be missing"
            LOG.error("%s", self.fault)

    @property
    def waiting(self) -> int:
        """Things not yet taken by the thread."""
        return self._queue.qsize()

    @property
    def behind_s(self) -> float:
        """Age of the oldest thing that is not on the disk, s, as far as the thread has taken it; 0 when all is."""
        oldest_s = self._oldest_s
        return 0.0 if oldest_s is None else self._clock() - oldest_s

    def _clock(self) -> float:
        """Time in which things were handed over, s: see `PAUSE_S`."""
        active_s, handed_s = self._handed
        return active_s + min(time.monotonic() - handed_s, PAUSE_S)

    def _run(self) -> None:
        try:
            self._work()
            self._store.finish()
        except OSError as error:
            again = f"end the run: it records nothing more; then {explain(error).partition('; ')[2]} and start anew"
            why = explain(error).partition("; ")[0]
            self._fail(f"the log {self.name} cannot be written: {why}; {again}. What was written before can be read")
        except BridgeError as error:
            self._fail(f"{error}. What was written before can be read")
        except Exception as error:  # whatever it is, the loop must learn that nothing is written any more
            LOG.debug("writing %s", self.name, exc_info=True)
            self._fail(f"the log {self.name} cannot be written ({type(error).__name__}: {error}); report this")

    def _work(self) -> None:
        due_s = time.monotonic() + self._flush_s
        while not (self._closing.is_set() and self._queue.empty()):
            taken = self._next(due_s - time.monotonic())
            if taken is not None:
                self._oldest_s = taken[0] if self._oldest_s is None else self._oldest_s
                self._store.keep(taken[1])
            self._progress_s = self._clock()
            if time.monotonic() >= due_s:
                self._flush()
                due_s = time.monotonic() + self._flush_s

    def _flush(self) -> None:
        if self._oldest_s is not None:
            self._store.flush()
        self._progress_s, behind_s = self._clock(), self.behind_s
        self._oldest_s = None
        if behind_s > LATE_S and time.monotonic() - self._logged_s > TALK_EVERY_S:
            self._logged_s = time.monotonic()
            LOG.warning("the log %s was %.1f s behind: the disk is slow", self.name, behind_s)

    def _next(self, wait_s: float) -> tuple[float, Item] | None:
        try:
            return self._queue.get(block=wait_s > 0.0, timeout=max(0.0, wait_s))
        except queue.Empty:
            return None

    def _fail(self, fault: str) -> None:
        self.fault = fault
        LOG.error("%s", fault)
        with contextlib.suppress(OSError):
            self._store.disk.close()
        while self._next(0.0) is not None:
            pass


class _TlogFile(Store[tuple[str, bytes, int]]):
    def keep(self, item: tuple[str, bytes, int]) -> None:
        direction, frame, unix_us = item
        link = 1 if direction == "out" else 0  # the two lowest bits of the time tell links apart
        self.disk.write(struct.pack(">Q", (max(0, unix_us) & ~3) | link) + frame)


class TlogWriter(AsyncWriter[tuple[str, bytes, int]]):
    """Writes packets of one endpoint as `mavlogdump.py` and ground stations read them; hand `on_bytes` to it.

    Args:
        path: of the new file, ``.tlog``.
        flush_s, capacity: see `AsyncWriter`.
        open_disk: makes the file.

    Raises:
        BridgeError: the file cannot be made.
    """

    def __init__(
        self, path: Path, *, flush_s: float = 0.5, capacity: int = 20_000, open_disk: Callable[[Path], Disk] = Disk
    ) -> None:
        self.path = path
        super().__init__(path.name, _TlogFile(open_disk(path)), capacity=capacity, flush_s=flush_s)

    def on_bytes(self, direction: str, raw: bytes, unix_us: int) -> None:
        """Take a whole frame as it came ("in") or went ("out"), at a time in us since 1970; never waits or raises."""
        with contextlib.suppress(BridgeError):  # said once by the writer; the black box makes the loop fall back
            self.put((direction, bytes(raw), unix_us))


def check_disk(folder: Path, *, boats: int, minutes: float = 120.0, name: str = "disk") -> CheckResult:
    """Check that logs can be written, fast enough and for long enough.

    Args:
        folder: where logs go; made when missing.
        boats: in the fleet.
        minutes: how long must fit.
        name: of the check.
    """
    needed_mib = boats * minutes * 60.0 * BYTES_PER_BOAT_S / 2**20
    try:
        make_folder(folder)
        with tempfile.TemporaryFile(dir=folder) as file:  # the time that the disk takes to keep a second's worth of log
            started = time.monotonic()
            file.write(os.urandom(_CHUNK))
            file.flush()
            os.fsync(file.fileno())
            sync_s = time.monotonic() - started
        free_mib = float(shutil.disk_usage(folder).free) / 2**20
    except OSError as error:
        return CheckResult(name, False, f"{folder}: {explain(error)}")
    figures = {"free_mib": free_mib, "needed_mib": needed_mib, "sync_s": sync_s}
    text = f"{folder}: {free_mib:.0f} MiB free, {needed_mib:.0f} MiB needed for {minutes:g} min"
    if free_mib < needed_mib:
        text = f"{text}; free space"
    elif sync_s > SLOWEST_SYNC_S:
        text = f"{folder}: the disk takes {sync_s:.1f} s to keep 64 KiB; set log_dir to a faster one"
    return CheckResult(name, free_mib >= needed_mib and sync_s <= SLOWEST_SYNC_S, text, figures)
