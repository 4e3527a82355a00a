"""The policy's own process, forked by `entries.sandbox`, which ends it when the runner is gone.

Reads pickled `Orders`, then snapshots; answers JSON.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import threading
import time
from multiprocessing.connection import Connection
from typing import Any

FAILED = 3
"""Exit status when the policy could not be loaded; the answer before it says why."""

GRACE_S = 5.0
"""Time the supervisor has to end this process once the runner is gone, s."""


class Slot:
    """Holds the latest snapshot, filled by a thread, so that a slow policy skips those it was too late for."""

    def __init__(self, snapshots: Connection) -> None:
        self._snapshots = snapshots
        self._ready = threading.Condition()
        self._message: bytes | None = None
        threading.Thread(target=self._fill, name="snapshots", daemon=True).start()

    def take(self) -> bytes:
        """The latest message not taken yet, waiting for it."""
        with self._ready:
            self._ready.wait_for(lambda: self._message is not None)
            message, self._message = self._message, None
        return message or b""

    def _fill(self) -> None:
        while True:
            try:
                message = self._snapshots.recv_bytes()
            except (OSError, EOFError):
                time.sleep(GRACE_S)  # the runner is gone, and the supervisor ends all this, whatever the policy is at
                os._exit(0)
            with self._ready:
                self._message = message
                self._ready.notify()


def serve(read_fd: int, write_fd: int, folder: str) -> int:
    """Load the policy the first message names and answer snapshots until the runner is gone."""
    snapshots, answers = Connection(read_fd, writable=False), Connection(write_fd, readable=False)
    try:
        orders = snapshots.recv_bytes()
    except EOFError:
        return 0
    from steerclear.shield.exceptions import SteerclearError

    from .player import load_player

    try:
        player = load_player(pickle.loads(orders))
    except SteerclearError as error:
        _answer(answers, {"failed": str(error)})
        return FAILED
    _answer(answers, {"ready": True})
    slot = Slot(snapshots)
    while True:
        snapshot = pickle.loads(slot.take())
        try:
            play = player.play(snapshot)
        except (SteerclearError, SystemExit) as error:
            _answer(answers, {"number": snapshot.number, "commands": None, "problems": [_line(error)]})
            continue
        rows = [[float(value) for value in row] if math.isfinite(row[0]) else None for row in play.commands]
        _answer(answers, {"number": snapshot.number, "commands": rows, "problems": list(play.problems)})


def _answer(answers: Connection, content: dict[str, Any]) -> None:
    answers.send_bytes(json.dumps(content, allow_nan=False).encode())


def _line(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
