"""`Keyboard`: single keys from the terminal, as they are pressed."""

from __future__ import annotations

import contextlib
import logging
import os
import select
import sys
import threading
from collections.abc import Callable

try:
    import termios
except ImportError:  # not a Unix: no key is read, Ctrl-C still ends the run
    termios = None  # type: ignore[assignment]

logger = logging.getLogger(__name__)

WAIT_S = 0.1
ESCAPE = "\x1b"
_NO_KEY = b"\x00"


class Keyboard:
    """Calls a function for every key, from a thread of its own, until closed. Ctrl-C stays what it is.

    Does nothing when the input is no terminal or the system has none that gives single keys, and while the process is
    in the background: reading or setting the terminal there would stop the whole process, and with it the boats.

    Args:
        pressed: called with each key, one character; what it raises is logged.
        descriptor: of the terminal; None: standard input.
    """

    def __init__(self, pressed: Callable[[str], None], descriptor: int | None = None) -> None:
        self._pressed = pressed
        self._closing = threading.Event()
        self._descriptor = _standard_input() if descriptor is None else descriptor
        self._before: list[object] | None = None
        self.is_terminal = self._descriptor is not None and os.isatty(self._descriptor) and termios is not None
        """Whether keys can come at all."""
        self._thread = threading.Thread(target=self._listen, name="keys", daemon=True)
        if self.is_terminal:
            self._thread.start()
        elif termios is None:
            logger.warning("this system gives no single keys to programs; stop with Ctrl-C")

    def close(self) -> None:
        """Leave the terminal as it was found; may be called again."""
        self._closing.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(timeout=2.0)

    def _listen(self) -> None:
        descriptor = self._descriptor
        if descriptor is None:
            return
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
                    self._press(data)
        except (OSError, termios.error) as error:  # the terminal was closed
            logger.warning("no more keys from the terminal (%s); stop with Ctrl-C or SIGTERM", error)
        finally:
            self._give_back(descriptor)

    def _press(self, data: bytes) -> None:
        text = data.decode(errors="replace")
        if text.startswith(ESCAPE) and len(text) > 1:
            return  # an arrow or function key
        for key in text:
            try:
                self._pressed(key)
            except Exception:  # the next key may be STOP ALL
                logger.exception("key %r failed", key)

    def _take_over(self, descriptor: int) -> None:
        """Keys one by one and unseen; repeated, since a shell may have set the terminal back meanwhile.

        Ctrl-Z would stop the process, and with it the shield; Ctrl-S would freeze the picture. Both are taken away.
        """
        present = termios.tcgetattr(descriptor)
        if self._before is None:
            self._before = termios.tcgetattr(descriptor)
        if present[3] & (termios.ICANON | termios.ECHO):
            present[0] &= ~(termios.IXON | termios.ICRNL)
            present[3] &= ~(termios.ICANON | termios.ECHO)
            for key, value in ((termios.VMIN, 1), (termios.VTIME, 0), (termios.VSUSP, _NO_KEY)):
                present[6][key] = value
            termios.tcsetattr(descriptor, termios.TCSANOW, present)

    def _give_back(self, descriptor: int) -> None:
        with contextlib.suppress(OSError, termios.error):
            if self._before is not None and _in_foreground(descriptor):
                termios.tcsetattr(descriptor, termios.TCSANOW, self._before)


def _standard_input() -> int | None:
    try:
        return sys.stdin.fileno()
    except (OSError, ValueError, AttributeError):
        return None


def _in_foreground(descriptor: int) -> bool:
    """Whether the terminal lets us read; one that does not control us always does."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        return True
