"""Measures that keep a run on time and in order: compilation beforehand, priorities, signals, asynchronous logs."""

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
from steerclear.shield.bridge.blackbox.disk import explain, make_folder
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.exceptions import BridgeError
from steerclear.shield.platforms import fresh_state, step_boat
from steerclear.shield.tracks import roll_out_pending, thrust_at

from ..terminal import SafeFormatter
from .orders import boats_of

LOOP_FIRST, OTHERS_FIRST = 2, 1
"""Real-time priorities of the loop's thread and of the runner's others, above all other programs, where allowed.

Nice values are not enough: at a load where the loop waits 0.2 ms with these priorities, it waits 18 ms with those."""
SWITCH_S = 0.0001  # how long another thread may hold the interpreter, s
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a run in order; SIGHUP comes when a terminal or its connection is closed."""
MOST_LINES = 10_000  # most log lines waiting to be written; further ones are dropped


def warm_up(fleet: FleetFile) -> None:
    """Compile all that the loop runs and read its value tables, so that its first turn is not slower.

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
    """Reduce pauses: existing objects are not garbage-collected, threads switch fast, and the process has priority."""
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
    """Raise the priority of this process's threads above other programs, where allowed; not of threads started later.

    The calling thread has the highest priority; if it may not be raised, the others are not raised either. Higher
    priorities are left as they are. All are restored at the end.
    """
    own, before = threading.get_native_id(), dict[int, tuple[int, int]]()
    for task in sorted(_tasks(), key=lambda task: task != own):
        with contextlib.suppress(OSError):  # the thread has ended, or permission is missing
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
            for given in (policy, policy | os.SCHED_RESET_ON_FORK):  # removing the flag may need permission
                with contextlib.suppress(OSError):
                    os.sched_setscheduler(task, given, os.sched_param(priority))
                    break


def _tasks() -> list[int]:
    """Return the ids of this process's threads, where the system lists them."""
    folder = Path("/proc/self/task")
    return [int(task.name) for task in folder.iterdir()] if folder.is_dir() else []


@contextlib.contextmanager
def ended_by_signals(operator: Operator) -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and SIGHUP end the run with boats stopped; a second signal interrupts at once."""
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
    """Write the log to a file, and to standard error when ``shown``, from a separate thread.

    A slow disk or terminal therefore does not delay the loop. An empty file is removed at the end. The black box, not
    this log, records the run.

    Raises:
        BridgeError: the file cannot be made.
    """
    handlers: list[logging.Handler] = [logging.StreamHandler()] if shown else []
    if path is not None:
        try:
            make_folder(path.parent)
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
                path.unlink()  # nothing was logged


class _Dropping(logging.handlers.QueueHandler):
    """Drops lines if too many wait."""

    def enqueue(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(queue.Full):
            self.queue.put_nowait(record)
