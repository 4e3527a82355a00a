"""The thread that lives a fleet's time at the pace of a clock, waking for packets in between."""

from __future__ import annotations

import logging
import selectors
import socket
import threading
import time
from collections.abc import Callable

from steerclear.shield.bridge.clock import Clock
from steerclear.shield.exceptions import ConfigError

logger = logging.getLogger(__name__)

_LONGEST_LAG_S = 1.0
"""Further behind its clock than this, a fleet lets the time go instead of living it in a rush."""
_LONGEST_WAIT_S = 0.1
"""Of the machine's time: how soon the end is noticed."""


class Pace:
    """Calls ``tick`` once every ``tick_s`` of the clock, and ``receive`` when there is something to read.

    Args:
        clock: the clock.
        tick_s: s.
        tick: lives one tick.
        receive: reads what came in; gets how far the clock is past the latest tick, s.

    Attributes:
        cpu_s: processor time of the thread, s.
        let_go_s: time that was not lived because the machine was too slow, s.
    """

    def __init__(self, clock: Clock, tick_s: float, tick: Callable[[], None], receive: Callable[[float], None]) -> None:
        self.clock = clock
        self.let_go_s = 0.0
        self.cpu_s = 0.0
        self._tick_s = tick_s
        self._tick = tick
        self._receive = receive
        self._sockets: Callable[[], list[socket.socket]] = list
        self._thread: threading.Thread | None = None
        self._ends = threading.Event()

    @property
    def is_running(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, sockets: Callable[[], list[socket.socket]]) -> None:
        """Start the thread.

        Args:
            sockets: those to wake for.

        Raises:
            ConfigError: it runs already.
        """
        if self.is_running:
            raise ConfigError("the fleet runs already")
        self._sockets = sockets
        self._ends.clear()
        self._thread = threading.Thread(target=self._run, name="sim-boats", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; may be called again."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        due = self.clock.now_s() + self._tick_s
        began_s = time.thread_time()
        while not self._ends.is_set():
            lag = self.clock.now_s() - due
            if lag < 0.0:
                self._wait(due)
                continue
            if lag > _LONGEST_LAG_S:
                logger.warning("simulated boats are %.1f s behind their clock and let the time go", lag)
                due += lag
                self.let_go_s += lag
            self._receive(min(lag, _LONGEST_LAG_S) + self._tick_s)
            self._tick()
            due += self._tick_s
            self.cpu_s = time.thread_time() - began_s

    def _wait(self, due_s: float) -> None:
        """Wait until then or until there is something to read, and read it."""
        left = (due_s - self.clock.now_s()) / getattr(self.clock, "speed", 1.0)
        patience = min(max(left, 0.0), _LONGEST_WAIT_S)
        sockets = self._sockets()
        if not sockets:
            time.sleep(patience)
            return
        with selectors.DefaultSelector() as selector:
            for entry in sockets:
                selector.register(entry, selectors.EVENT_READ)
            readable = bool(selector.select(patience))
        if readable:
            self._receive(self.clock.now_s() - due_s + self._tick_s)
