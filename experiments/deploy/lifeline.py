"""Programs that end with the one that started them, however that one ended."""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import BinaryIO

GRACE_S = 3.0
"""How long a program may take to end in order, s."""


def end_with_parent(stream: BinaryIO | None = None) -> threading.Thread:
    """End this process in order (SIGTERM) when a stream is closed at its other end, at once `GRACE_S` later.

    Whoever starts a program with a pipe as its standard input holds the only other end: the system closes it also when
    that process is killed with -9.

    Args:
        stream: the stream; None: standard input.

    Returns:
        The thread that waits for it.
    """
    watched = sys.stdin.buffer if stream is None else stream
    thread = threading.Thread(target=_wait, args=(watched,), name="lifeline", daemon=True)
    thread.start()
    return thread


def _wait(stream: BinaryIO) -> None:
    while os.read(stream.fileno(), 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait(GRACE_S)
    os._exit(1)
