"""`Dashboard`: a live picture of the run in the terminal, and the operator's keys."""

from __future__ import annotations

import atexit
import logging
import math
import threading
import time
from collections import deque

from rich.console import Console
from rich.live import Live
from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.bridge.operator import Operator

from ..terminal import SafeConsole, SafeFormatter
from .controls import Controls, Keyboard
from .dashboard_view import SILENT_S, Moment, View

logger = logging.getLogger(__name__)

REFRESH_HZ = 4.0
LOG_LINES = 3
"""Lines of the log on the screen."""
LATE_OF = 100
"""Ticks that the shown delays are of."""


class Dashboard:
    """A `TickSink` that shows the latest tick, and takes keys. A thread draws, another listens to the keyboard.

    It draws when a tick has come, so while the loop rests till the next, and when a key was pressed. Keys act at once
    and do not wait for the picture; when drawing fails, they go on.

    Args:
        fleet, clock: the loop's.
        operator: gets what the keys ask for.
        console: where to draw; None: standard output.
        keyboard: descriptor of the terminal that keys come from; None: standard input.
        refresh_hz: pictures a second, at most.
    """

    def __init__(
        self,
        fleet: FleetFile,
        operator: Operator,
        clock: Clock,
        *,
        console: Console | None = None,
        keyboard: int | None = None,
        refresh_hz: float = REFRESH_HZ,
    ) -> None:
        self._operator, self._clock = operator, clock
        self._view = View(fleet)
        self._console = console or SafeConsole()
        self._period_s = 1.0 / refresh_hz
        self._tick: Tick | None = None
        self._late_s: deque[float] = deque(maxlen=LATE_OF)
        self._drawn_s = -math.inf
        self._wake = threading.Event()
        self._closing = False
        self._log = LogLines()
        self._controls = Controls(fleet, operator, clock)
        self._keyboard = Keyboard(self.press, keyboard)
        self._thread = threading.Thread(target=self._draw, name="dashboard", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    def take(self, tick: Tick) -> None:
        """Show this tick from the next picture on."""
        self._tick = tick
        self._late_s.append(tick.began_s - tick.due_s)
        if time.monotonic() - self._drawn_s >= self._period_s:
            self._wake.set()

    def press(self, key: str) -> None:
        """Act on a key."""
        self._controls.press(key)
        self._wake.set()

    def moment(self) -> Moment:
        """What is to be shown now."""
        late_s = tuple(self._late_s) or (0.0,)
        return Moment(
            tick=self._tick,
            now_s=self._clock.now_s(),
            stopped=self._operator.stopped,
            hard=self._operator.hard,
            ended=self._operator.ended,
            late_s=(sum(late_s) / len(late_s), max(late_s)),
            menu=self._controls.menu(),
            log=list(self._log.lines)[-LOG_LINES:],
        )

    def close(self) -> None:
        """Give the terminal back and repeat on it what was logged meanwhile; may be called again."""
        if self._closing:
            return
        self._closing = True
        self._wake.set()
        self._keyboard.close()
        self._thread.join(timeout=5.0)
        atexit.unregister(self.close)
        if self._thread.is_alive():
            return  # the terminal takes nothing any more; what would be written now would wait for ever
        for line in self._log.lines:
            self._console.print(line, markup=False, soft_wrap=True)

    def _draw(self) -> None:
        try:
            with self._log, Live(console=self._console, screen=True, auto_refresh=False, redirect_stdout=False) as live:
                while not self._closing:
                    self._drawn_s = time.monotonic()
                    size = self._console.size
                    live.update(self._view.of(self.moment(), size.width, size.height), refresh=True)
                    self._wake.wait(max(self._period_s, SILENT_S))
                    self._wake.clear()
        except Exception:  # boats go on without a picture; the keys still work
            logger.exception("the dashboard cannot be drawn any more; keys still work: SPACE is STOP ALL")


class LogLines(logging.Handler):
    """Takes what is logged while the screen is in use, in place of handlers that would write over it."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.setFormatter(SafeFormatter("%(asctime)s %(levelname)s %(message)s", "%H:%M:%S"))
        self.lines: deque[str] = deque(maxlen=200)
        """The latest lines; older ones are gone."""
        self._aside: list[logging.Handler] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line."""
        self.lines.append(self.format(record).replace("\n", " | "))

    def __enter__(self) -> LogLines:
        root = logging.getLogger()
        self._aside = [handler for handler in root.handlers if type(handler) is logging.StreamHandler]
        for handler in self._aside:
            root.removeHandler(handler)
        root.addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        root = logging.getLogger()
        root.removeHandler(self)
        for handler in self._aside:
            root.addHandler(handler)
