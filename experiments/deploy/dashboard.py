"""`Dashboard`: the operator's terminal display and keys; neither ever makes the loop wait."""

from __future__ import annotations

import atexit
import contextlib
import logging
import math
import os
import select
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from rich.console import Console
from rich.live import Live
from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.failsafe_table import DISABLES
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.exceptions import ConfigError

from ..terminal import SafeConsole, SafeFormatter
from .dashboard_view import SILENT_S, Moment, View

try:
    import termios
except ImportError:  # not a Unix: no key is read, Ctrl-C still ends the run
    termios = None  # type: ignore[assignment]

logger = logging.getLogger(__name__)

STOP_KEYS = (" ", "s", "S")
BY = "keyboard"
DURATIONS_S = (10.0, 30.0, 60.0, 300.0)
DIGITS = "123456789abcdefgh"
TITLES = {
    "hard": "Stop past the shield, whatever is near? y: yes. Boats already stop through the shield",
    "resume": "Take STOP ALL back? y: boats move again",
    "take": "Take which boat back? Its pilot must have let go of it. It is logged. ESC leaves",
    "take_sure": "{subject}: GUIDED and arming are asked for, and it obeys the policy. y: yes",
    "condition": "Switch off which response, for a time? It is logged. ESC leaves",
    "subject": "{condition}: for which boat?",
    "duration": "{condition} of {whom}: for how long? It disables {disabled}",
}
"""Question of each menu."""
OPENS = {"o": "condition", "t": "take"}
WAIT_S = 0.1
_NO_KEY = b"\x00"


class Controls:
    """Turns keys into calls of the operator. A stop key works whatever menu is open.

    If boats already stop through the shield, a stop key asks whether to stop past it. Only another key can confirm, so
    neither a double tap nor a held key switches the shield off.
    """

    def __init__(self, fleet: FleetFile, operator: Operator, clock: Clock) -> None:
        self._operator, self._clock = operator, clock
        self._lock = threading.Lock()
        self._open = self._condition = self._subject = self._said = ""
        self._confirmed: dict[str, Callable[[], object]] = {
            "hard": lambda: operator.stop_all(BY),
            "resume": lambda: operator.resume(BY),
            "take_sure": lambda: operator.take_back(self._subject, BY),
        }
        ours = [boat.name for boat in fleet.ours if boat.link is not None and boat.commanded]
        options: dict[str, Iterable[Any]] = {
            "take": ours,
            "condition": DISABLES,
            "subject": ("all", *fleet.names),
            "duration": DURATIONS_S,
        }
        self._options = {menu: dict(zip(DIGITS, entries, strict=False)) for menu, entries in options.items()}

    def press(self, key: str) -> None:
        """Act on a key; unknown keys are ignored."""
        with self._lock:
            asked, self._open = self._open, ""
            if key in STOP_KEYS:
                if not self._operator.stopped:
                    self._operator.stop_all(BY)
                elif not self._operator.hard:
                    self._open = "hard"
                else:
                    self._open = asked
            elif asked in self._confirmed:
                if key in ("y", "Y"):
                    self._confirmed[asked]()
            elif asked:
                if key in self._options[asked]:
                    self._choose(asked, self._options[asked][key])
            else:
                self._command(key.lower())

    def menu(self) -> list[str]:
        """Return the lines of the open menu; empty if none is open."""
        with self._lock:
            if not self._open:
                return []
            parts = {"condition": self._condition, "subject": self._subject, "whom": self._subject or "all"}
            lines = [TITLES[self._open].format(**parts, disabled=DISABLES.get(self._condition, ""))]
            options = self._options.get(self._open, {})
            if self._open == "condition":
                lines += [f" {key} {name}: disables {DISABLES[name]}" for key, name in options.items()]
            elif options:
                seconds = self._open == "duration"
                lines.append("   ".join(f"{key} {f'{one:g} s' if seconds else one}" for key, one in options.items()))
            return [*lines, *([self._said] if self._said else [])]

    def _command(self, key: str) -> None:
        self._said = ""
        if key == "q":
            self._operator.end(BY)
        elif key == "r" and self._operator.stopped:
            self._open = "resume"
        else:
            self._open = OPENS.get(key, "")

    def _choose(self, menu: str, chosen: str | float) -> None:
        if menu == "take":
            self._subject, self._open = str(chosen), "take_sure"
        elif menu == "condition":
            self._condition, self._open = str(chosen), "subject"
        elif menu == "subject":
            self._subject, self._open = "" if chosen == "all" else str(chosen), "duration"
        else:
            try:
                self._operator.override(self._condition, self._subject, float(chosen), self._clock.now_s(), BY)
            except ConfigError as error:
                self._open, self._said = "condition", str(error)


class Keyboard:
    """Calls a function for every key, from its own thread, until closed. Ctrl-C works as usual.

    It does nothing if the input is not a terminal with single keys, or while the process is in the background: terminal
    access would then stop the process, and with it the boats.

    Args:
        pressed: called with each key, one character; its exceptions are logged.
        descriptor: of the terminal; None: standard input.

    Attributes:
        is_terminal: whether keys can arrive at all.
    """

    def __init__(self, pressed: Callable[[str], None], descriptor: int | None = None) -> None:
        self._pressed = pressed
        self._closing = threading.Event()
        if descriptor is None:
            with contextlib.suppress(OSError, ValueError, AttributeError):
                descriptor = sys.stdin.fileno()
        self._before: list[Any] | None = None
        self.is_terminal = descriptor is not None and os.isatty(descriptor) and termios is not None
        self._thread = threading.Thread(target=self._listen, args=(descriptor,), name="keys", daemon=True)
        if self.is_terminal:
            self._thread.start()
        elif termios is None:
            logger.warning("this system gives no single keys to programs; stop with Ctrl-C")

    def close(self) -> None:
        """Restore the terminal; may be called again."""
        self._closing.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(timeout=2.0)

    def _listen(self, descriptor: int) -> None:
        try:
            while not self._closing.is_set():
                if not _in_foreground(descriptor):
                    self._closing.wait(WAIT_S)
                    continue
                self._take_over(descriptor)
                ready, _, _ = select.select([descriptor], [], [], WAIT_S)
                if ready and _in_foreground(descriptor):
                    data = os.read(descriptor, 256)
                    if not data:
                        return
                    self._press(data.decode(errors="replace"))
        except (OSError, termios.error) as error:  # the terminal was closed
            logger.warning("no more keys from the terminal (%s); stop with Ctrl-C or SIGTERM", error)
        finally:
            with contextlib.suppress(OSError, termios.error):
                if self._before is not None and _in_foreground(descriptor):
                    termios.tcsetattr(descriptor, termios.TCSANOW, self._before)

    def _press(self, text: str) -> None:
        if text.startswith("\x1b") and len(text) > 1:
            return  # an arrow or function key
        for key in text:
            try:
                self._pressed(key)
            except Exception:  # the next key may be STOP ALL
                logger.exception("key %r failed", key)

    def _take_over(self, descriptor: int) -> None:
        """Switch to single keys without echo; repeated, since a shell may have reset the terminal meanwhile.

        Ctrl-Z and Ctrl-S are disabled: they would stop the process with the shield, or freeze the display.
        """
        present = termios.tcgetattr(descriptor)
        self._before = self._before or termios.tcgetattr(descriptor)
        if present[3] & (termios.ICANON | termios.ECHO):
            present[0] &= ~(termios.IXON | termios.ICRNL)
            present[3] &= ~(termios.ICANON | termios.ECHO)
            for key, value in ((termios.VMIN, 1), (termios.VTIME, 0), (termios.VSUSP, _NO_KEY)):
                present[6][key] = value
            termios.tcsetattr(descriptor, termios.TCSANOW, present)


def _in_foreground(descriptor: int) -> bool:
    """Whether the terminal may be read; true for one that does not control this process."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        return True


REFRESH_HZ = 4.0
LOG_LINES = 3  # number of log lines on the screen
LATE_OF = 100  # number of latest ticks over which delays are shown


class Dashboard:
    """A `TickSink` that shows the latest tick and takes keys, with one thread to draw and one for the keyboard.

    It draws after a tick, while the loop waits for the next, or after a key. Keys act immediately, and still work if
    drawing fails.

    Args:
        fleet, clock: the loop's.
        operator: receives the keys' requests.
        console: where to draw; None: standard output.
        keyboard: descriptor of the terminal for keys; None: standard input.
        refresh_hz: highest rate of drawing.
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
        """Show this tick at the next redraw."""
        self._tick = tick
        self._late_s.append(tick.began_s - tick.due_s)
        if time.monotonic() - self._drawn_s >= self._period_s:
            self._wake.set()

    def press(self, key: str) -> None:
        """Act on a key."""
        self._controls.press(key)
        self._wake.set()

    def moment(self) -> Moment:
        """Return what to show now."""
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
        """Restore the terminal and print what was logged meanwhile; may be called again."""
        if self._closing:
            return
        self._closing = True
        self._wake.set()
        self._keyboard.close()
        self._thread.join(timeout=5.0)
        atexit.unregister(self.close)
        if self._thread.is_alive():
            return  # the terminal accepts no output; printing would block for ever
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
        except Exception:  # boats continue without a display; the keys still work
            logger.exception("the dashboard cannot be drawn any more; keys still work: SPACE is STOP ALL")


class LogLines(logging.Handler):
    """Collects log lines while the screen is in use, instead of handlers that would write over it."""

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
