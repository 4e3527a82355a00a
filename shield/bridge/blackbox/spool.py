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
        self._queue: queue.Queue[Item | None] = queue.Queue(capacity)
        self._closing = threading.Event()
        self._progress_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, name=f"log {name}", daemon=True)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Hand one thing over; never waits.

        Raises:
            BridgeError: nothing is written any more.
        """
        if self.fault or self._closing.is_set():
            raise BridgeError(self.fault or f"the log {self.name} is closed; open another one")
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self._drop()
        stuck_s = time.monotonic() - self._progress_s
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
        except Exception as error:  # whatever it is, the loop must learn that nothing is written any more
            LOG.debug("writing %s", self.name, exc_info=True)
            self._fail(f"the log {self.name} cannot be written ({type(error).__name__}: {error}); report this")

    def _work(self) -> None:
        due_s, unwritten = time.monotonic() + self._flush_s, False
        while not (self._closing.is_set() and self._queue.empty()):
            item = self._next(due_s - time.monotonic())
            if item is not None:
                self._store.keep(item)
                unwritten = True
            self._progress_s = time.monotonic()
            if self._progress_s >= due_s:
                if unwritten:
                    self._store.flush()
                self._progress_s = time.monotonic()
                due_s, unwritten = self._progress_s + self._flush_s, False

    def _next(self, wait_s: float) -> Item | None:
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
