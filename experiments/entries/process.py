"""`EntryProcess`: the runner's side of an entry's process. Each call waits for the answer, for a limited time.

Processes are used again for the next game: what ran there is gone by then, and the supervisor forks anew.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib.util
import json
import pickle
import time
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from steerclear.policies.registry import SB3_PREFIX
from steerclear.shield.exceptions import PolicyError

from ..deploy.worker import Broken, Worker
from .imports import imports_of
from .sandbox import Limits

PART = "steerclear.experiments.entries.child"
LOAD_S = 120.0
"""Time an entry has to load and to begin a game, s."""
OVER_S = 3.0
"""Time for a game's process to be gone, s."""
MOST_IDLE = 2
"""Processes kept for later games."""
HEAVY = ("torch", "stable_baselines3")
"""Modules that take long to import: done once for all games of an entry that imports them."""
_IDLE: list[Worker] = []


class Lost(Exception):
    """The entry's process is of no use any more; the text says what it did."""


class EntryProcess:
    """One entry in a process of its own, for one game.

    Args:
        policy: path, as `steerclear.policies.make` takes it.
        limits: of the process.
    """

    def __init__(self, policy: str, limits: Limits) -> None:
        self._worker: Worker | None = _worker(limits, heavy_modules(policy))

    def ask(self, *order: Any, timeout_s: float = LOAD_S) -> dict[str, Any]:
        """Give an order and wait for the answer.

        Raises:
            Lost: the process did not answer in time, ended, or was ended; it is gone.
        """
        worker = self._worker
        if worker is None:
            raise Lost("it is gone")
        try:
            worker.send(pickle.dumps(order, pickle.HIGHEST_PROTOCOL))
            return _content(self._answer(worker, timeout_s))
        except Broken as error:
            said = worker.epitaph(str(error))
            self.end()
            raise Lost(said) from None

    def over(self) -> None:
        """The game is over: end what ran there, and keep the process for the next game if all went well."""
        worker, self._worker = self._worker, None
        if worker is None:
            return
        with contextlib.suppress(Broken):
            worker.send(pickle.dumps(("over",)))
            if worker.is_fresh(OVER_S) and len(_IDLE) < MOST_IDLE:
                _IDLE.append(worker)
                return
        worker.end()

    def end(self) -> None:
        """End the process at once, with all it started."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()

    def _answer(self, worker: Worker, timeout_s: float) -> bytes:
        end_s = time.monotonic() + timeout_s
        while True:
            left_s = end_s - time.monotonic()
            worker.await_turn(min(max(left_s, 0.0), 0.5))
            worker.flush()
            messages = worker.messages()
            if len(messages) > 1:
                raise Broken("it answers what it was not asked")
            if messages:
                return messages[0]
            if worker.prints_too_much:
                raise Broken(f"it printed more than {worker.limits.output_bytes} bytes; its process was ended")
            if left_s <= 0.0:
                raise Broken(f"it did not answer within {timeout_s:g} s; its process was ended")


@lru_cache(maxsize=64)
def heavy_modules(policy: str) -> tuple[str, ...]:
    """Those of `HEAVY` that an entry imports by name, and that are installed."""
    if policy.startswith(SB3_PREFIX):
        wanted = set(HEAVY)
    else:
        try:
            wanted = set(imports_of(policy).needed)
        except PolicyError:
            wanted = set()  # whoever loads it will say so
    return tuple(name for name in HEAVY if name in wanted and importlib.util.find_spec(name) is not None)


def _worker(limits: Limits, preload: tuple[str, ...]) -> Worker:
    for worker in list(_IDLE):
        if worker.is_gone:
            _IDLE.remove(worker)
            worker.end()
        elif (worker.limits, worker.preload) == (limits, preload):
            _IDLE.remove(worker)
            return worker
    while len(_IDLE) >= MOST_IDLE:
        _IDLE.pop(0).end()
    return Worker(b"", PART, limits, preload)


@atexit.register
def _end_idle() -> None:
    while _IDLE:
        _IDLE.pop().end()


def _content(message: bytes) -> dict[str, Any]:
    try:
        content: Any = json.loads(message)
    except (ValueError, RecursionError):
        raise Broken("its answer is not JSON") from None
    if not isinstance(content, Mapping):
        raise Broken("its answer is no object")
    return dict(content)
