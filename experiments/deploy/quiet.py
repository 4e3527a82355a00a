"""What keeps a run in time and in order: compiling beforehand, few pauses, signals, and logs that make nobody wait."""

from __future__ import annotations

import contextlib
import gc
import logging
import logging.handlers
import os
import queue
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from steerclear.shield import Shield
from steerclear.shield.bridge.blackbox.disk import explain
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.exceptions import BridgeError
from steerclear.shield.platforms import fresh_state, step_boat
from steerclear.shield.tracks import roll_out_pending, thrust_at

from ..terminal import SafeFormatter
from .orders import boats_of

LOOP_FIRST, OTHERS_FIRST = 2, 1
"""Real-time priorities of the loop's thread and of the runner's others, where the system allows them: before all other
programs. A nicer program still makes the loop wait for its turn, 18 ms at the load where this makes it 0.2 ms."""
SWITCH_S = 0.0001
"""How long another thread may keep the interpreter from the loop, s."""
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a run in order; the last comes when a terminal or its connection is closed."""
MOST_LINES = 10_000
"""Lines of the log that may wait to be written; more are dropped."""


def warm_up(fleet: FleetFile) -> None:
    """Compile all that the loop runs and read its value tables, so that its first turn is as quick as any.

    Raises:
        TableError: a value table cannot be read.
    """
    Shield(fleet.shield_config).warm_up(boats_of(fleet))
    for platform in set(fleet.platform_of.values()):
        params, row = platform.pack(), fresh_state(0.0, 0.0, 0.0)
        step_boat(params, row, 1.0, 0.0, fleet.dt_s)
        thrust_at(params, 1.0)
        roll_out_pending(row[None].copy(), np.ones(1, np.bool_), params[None].copy(), np.zeros((1, 1, 2)), fleet.dt_s)


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Fewer pauses: no search for garbage in what was made so far, quick hand-over of threads, other programs wait."""
    interval = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)
    try:
        with before_others():
            yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()


@contextlib.contextmanager
def before_others() -> Iterator[None]:
    """All threads of this process go before other programs, as far as the system lets them; what is started later not.

    The calling thread goes before the others of this process; where it may not, they stay behind it too. A thread that
    has more already keeps it, and each is given back what it had.
    """
    own, before = threading.get_native_id(), dict[int, tuple[int, int]]()
    for task in sorted(_tasks(), key=lambda task: task != own):
        with contextlib.suppress(OSError):  # it has ended, or this is a right that we have not
            has = os.sched_getscheduler(task), os.sched_getparam(task).sched_priority
            first = LOOP_FIRST if task == own else OTHERS_FIRST
            if has[1] < first:
                os.sched_setscheduler(task, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(first))
            before[task] = has
        if own not in before:
            break
    try:
        yield
    finally:
        for task, (policy, priority) in before.items():
            for given in (policy, policy | os.SCHED_RESET_ON_FORK):  # few have the right to take the flag off
                with contextlib.suppress(OSError):
                    os.sched_setscheduler(task, given, os.sched_param(priority))
                    break


def _tasks() -> list[int]:
    """Numbers of this process's threads, where the system tells them."""
    folder = Path("/proc/self/task")
    return [int(task.name) for task in folder.iterdir()] if folder.is_dir() else []


@contextlib.contextmanager
def ended_by_signals(operator: Operator) -> Iterator[None]:
    """Ctrl-C, SIGTERM and SIGHUP end the run in order, boats stopped; a second one does not wait for that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> Any:
        if operator.ended:
            raise KeyboardInterrupt
        operator.end(signal.Signals(number).name)

    before = {number: signal.signal(number, end) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def logging_aside(path: Path | None, shown: bool) -> Iterator[None]:
    """Write the log to a file, and to standard error when ``shown``, from a thread of its own.

    Whatever a disk or a terminal does, logging costs the loop no time. The file is left only where something was
    logged: warnings and failures; what happened in a run is in its black box.

    Raises:
        BridgeError: the file cannot be made.
    """
    handlers: list[logging.Handler] = [logging.StreamHandler()] if shown else []
    if path is not None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handlers.append(logging.FileHandler(path, encoding="utf-8"))
        except OSError as error:
            raise BridgeError(f"cannot begin the log {path}: {explain(error)}") from None
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


class _Dropping(logging.handlers.QueueHandler):
    """Drops lines when too many wait."""

    def enqueue(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(queue.Full):
            self.queue.put_nowait(record)
