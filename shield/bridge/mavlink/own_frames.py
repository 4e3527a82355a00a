"""`Source`: our own ids on a wire, and the frames that lately left under them.

Radios and routers reflect: what we sent comes back. By its ids alone it cannot be told from another program that took
the same ids, and that one would be a second commander; by its bytes it can.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict

ECHO_S = 3.0
"""An echo is back within this time; the same bytes later are old commands that somebody plays again."""
_MOST = 4096


class Source(tuple[int, int]):
    """System and component id of one sender; equal to the plain pair. May be used from any thread.

    Args:
        system, component: the ids.
    """

    _sent: OrderedDict[bytes, float]
    _lock: threading.Lock

    def __new__(cls, system: int, component: int) -> Source:
        """Of which nothing was sent yet."""
        source = super().__new__(cls, (system, component))
        source._sent = OrderedDict()
        source._lock = threading.Lock()
        return source

    def note(self, frame: bytes) -> None:
        """This frame leaves now."""
        with self._lock:
            self._sent[frame] = time.monotonic()
            self._sent.move_to_end(frame)
            while len(self._sent) > _MOST:
                self._sent.popitem(last=False)

    def sent_lately(self, frame: bytes) -> bool:
        """Whether exactly this frame left within `ECHO_S`."""
        with self._lock:
            return time.monotonic() - self._sent.get(frame, -ECHO_S) < ECHO_S
