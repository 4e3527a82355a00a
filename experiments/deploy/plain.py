"""A line now and then about a run, its figures, and logs that never make the loop wait."""

from __future__ import annotations

import contextlib
import logging
import logging.handlers
import math
import queue
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from steerclear.shield.bridge.blackbox.disk import explain
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import BridgeError
from steerclear.shield.fleet import Fleet
from steerclear.shield.platforms import layout as L

from ..terminal import SafeFormatter


class Tally:
    """Counts decisions and keeps the closest approach of own boats to any other.

    Attributes:
        commands: of own boats that were decided.
        changed: of these, by the shield.
        closest_m: closest approach, as believed, m; inf: nobody else was there.
    """

    def __init__(self) -> None:
        self._ticks = self._decided = self._best_effort = self._responses = 0
        self.commands = self.changed = 0
        self.closest_m = math.inf
        self._least_m = math.inf

    def take(self, tick: Tick) -> None:
        """Count one tick."""
        self._ticks += 1
        self._responses += any(action.response != "none" for action in tick.actions)
        decisions = tick.decisions
        if decisions is None or tick.fleet is None:
            return
        own = tick.fleet.controlled
        self._decided += 1
        self.commands += int(own.sum())
        self.changed += decisions.count_intervened
        self._best_effort += int((decisions.reason[own] == Reason.BEST_EFFORT).sum())
        self._least_m = min(self._least_m, float(decisions.safety_margin_m[own].min(initial=math.inf)))
        self.closest_m = min(self.closest_m, closest_m(tick.fleet))

    def close(self) -> None:
        """Nothing to finish."""

    def figures(self) -> dict[str, float]:
        """Ticks, shares of commands changed, closest approach m (as believed), least certificate m."""
        return {
            "ticks": float(self._ticks),
            "decided": float(self._decided),
            "changed_share": self.changed / max(1, self.commands),
            "best_effort_commands": float(self._best_effort),
            "ticks_with_actions": float(self._responses),
            "closest_m": self.closest_m,
            "least_certificate_m": self._least_m,
        }


def closest_m(fleet: Fleet) -> float:
    """Smallest distance of a controlled boat from any other, m, where they are believed to be."""
    at = fleet.state[:, [L.X, L.Y]]
    apart = np.hypot(*np.moveaxis(at[:, None] - at[None], -1, 0))
    np.fill_diagonal(apart, np.inf)
    return float(apart[fleet.controlled].min(initial=math.inf))


MOST_LINES = 10_000
"""Lines of the log that may wait to be written; more are dropped."""


class PlainLines:
    """A sink that says how it went since the last line, every few seconds, from a thread of its own.

    What is declared of a boat is said once, and again when its response changes or it comes back; of one outside the
    geofence every time, since how far matters.

    Args:
        say: takes a line.
        every_s: s.
    """

    def __init__(self, say: Callable[[str], None], every_s: float = 5.0) -> None:
        self._say, self._every_s = say, every_s
        self._tick: Tick | None = None
        self._began_s: float | None = None
        self._tally = Tally()
        self._told: set[tuple[str, str, str]] = set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plain lines", daemon=True)
        self._thread.start()

    def take(self, tick: Tick) -> None:
        """Have this tick told next."""
        if self._began_s is None:
            self._began_s = tick.began_s
        self._tick = tick
        self._tally.take(tick)

    def close(self) -> None:
        """Say the last and end."""
        self._closing.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._closing.wait(self._every_s):
            if self._tick is None:
                continue
            since, self._tally = self._tally, Tally()  # no lock: the loop is never to wait for this thread
            self._say(self._line(self._tick, since))
            new = {(action.subject, action.condition, action.response): action.text for action in self._tick.actions}
            for key, text in new.items():
                if key not in self._told or key[1] == "geofence":
                    self._say(f"  {text}")
            self._told = set(new)

    def _line(self, tick: Tick, since: Tally) -> str:
        seconds = tick.began_s - (self._began_s or 0.0)
        if tick.fleet is None or tick.decisions is None:
            return f"{seconds:6.0f} s  no decision"
        near = "no other boat" if math.isinf(since.closest_m) else f"closest {since.closest_m:5.1f} m"
        changed = f"{since.changed} of {since.commands} commands changed"
        return f"{seconds:6.0f} s  {near}, {changed}, policy {1e3 * tick.policy_age_s:.0f} ms old"


@contextlib.contextmanager
def logging_aside(path: Path | None, shown: bool) -> Iterator[None]:
    """Write the log to a file, and to standard error when ``shown``, from a thread of its own.

    Whatever a disk or a terminal does, logging costs the loop no time. The file is left only where something was
    logged: warnings and failures; what happened in a run is in its black box.

    Raises:
        BridgeError: the file cannot be made.
    """
    handlers: list[logging.Handler] = []
    if path is not None:
        handlers.append(_file(path))
    if shown:
        handlers.append(logging.StreamHandler())
    for handler in handlers:
        handler.setFormatter(SafeFormatter("%(asctime)s %(levelname)s %(message)s"))
    root, line = logging.getLogger(), _Dropping(queue.Queue(MOST_LINES))
    listener = logging.handlers.QueueListener(line.queue, *handlers)
    before = root.level
    root.addHandler(line)
    root.setLevel(logging.INFO)
    listener.start()
    try:
        yield
    finally:
        root.removeHandler(line)
        root.setLevel(before)
        listener.stop()
        for handler in handlers:
            handler.close()
        with contextlib.suppress(OSError):
            if path is not None and path.stat().st_size == 0:
                path.unlink()  # nothing had to be said


def _file(path: Path) -> logging.Handler:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return logging.FileHandler(path, encoding="utf-8")
    except OSError as error:
        raise BridgeError(f"cannot begin the log {path}: {explain(error)}") from None


class _Dropping(logging.handlers.QueueHandler):
    """Drops lines when too many wait."""

    def enqueue(self, record: logging.LogRecord) -> None:
        """Hand a line over, or drop it."""
        with contextlib.suppress(queue.Full):
            self.queue.put_nowait(record)
