"""`Spool`: a bounded queue with a thread behind it, so that a slow disk never delays who hands things over."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
import time
from typing import Generic, Protocol, TypeVar

from ...exceptions import BridgeError
from .disk import explain

LOG = logging.getLogger(__name__)

LATE_S, TALK_EVERY_S = 1.0, 30.0
"""A disk that is so much behind is told, s, and again after the other."""
PAUSE_S = 0.5
"""Of the time between two things handed over no more than this counts against the disk, s: whoever hands them over
stood still for the rest (a suspended process, say), and the thread may have, too."""

Item = TypeVar("Item")
Taken = TypeVar("Taken", contravariant=True)


class Store(Protocol[Taken]):
    """What the thread does with things; only ever called from that thread."""

    def keep(self, item: Taken) -> None:
        """Take one thing."""

    def flush(self) -> None:
        """Bring what was taken to the disk."""

    def finish(self) -> None:
        """Complete and close the file."""

    def abandon(self) -> None:
        """Close the file as it is."""


class Spool(Generic[Item]):
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
        self._told_s = -TALK_EVERY_S
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
            self._drop()
        stuck_s = active_s - self._progress_s
        if stuck_s > self._give_up_s and self._queue.qsize() > 1:
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

    def _drop(self) -> None:
        if self.dropped == 0:
            LOG.warning("the log %s: the disk is too slow, %d entries wait, more are dropped", self.name, self.waiting)
        self.dropped += 1

    def _run(self) -> None:
        try:
            self._work()
            self._store.finish()
        except OSError as error:
            self._fail(f"the log {self.name} cannot be written: {explain(error)}. What was written before can be read")
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
        if behind_s > LATE_S and time.monotonic() - self._told_s > TALK_EVERY_S:
            self._told_s = time.monotonic()
            LOG.warning("the log %s was %.1f s behind: the disk is slow", self.name, behind_s)

    def _next(self, wait_s: float) -> tuple[float, Item] | None:
        try:
            return self._queue.get(timeout=max(0.0, wait_s)) if wait_s > 0.0 else self._queue.get_nowait()
        except queue.Empty:
            return None

    def _fail(self, fault: str) -> None:
        self.fault = fault
        LOG.error("%s", fault)
        try:
            self._store.abandon()
        except OSError:
            LOG.debug("closing %s", self.name, exc_info=True)
        while self._next(0.0) is not None:
            pass
