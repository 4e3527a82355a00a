"""What keeps a run in time and in order: compiling beforehand, few pauses, real-time priority, signals."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from steerclear.shield import Shield
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.platforms import fresh_state, step_boat

from .orders import boats_of

LOOP_FIRST, OTHERS_FIRST = 2, 1
"""Real-time priorities of the loop's thread and of the runner's others, where the system allows them: before all other
programs. A nicer program still makes the loop wait for its turn, 18 ms at the load where this makes it 0.2 ms."""

SWITCH_S = 0.0001
"""How long another thread may keep the interpreter from the loop, s."""


def warm_up(fleet: FleetFile) -> None:
    """Compile all that the loop runs and read its value tables, so that its first turn is as quick as any.

    Raises:
        TableError: a value table cannot be read.
    """
    Shield(fleet.shield_config).warm_up(boats_of(fleet))
    for platform in set(fleet.platform_of.values()):
        step_boat(platform.pack(), fresh_state(0.0, 0.0, 0.0), 1.0, 0.0, fleet.dt_s)


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
    own = threading.get_native_id()
    before = {task: place for task in _tasks() if (place := _place(task)) is not None}
    if own in before and _schedule(own, before[own][1], LOOP_FIRST):
        for task in before.keys() - {own}:
            _schedule(task, before[task][1], OTHERS_FIRST)
    try:
        yield
    finally:
        for task, (policy, priority) in before.items():
            for given in (policy, policy | os.SCHED_RESET_ON_FORK):  # few have the right to take the flag off
                with contextlib.suppress(OSError):
                    os.sched_setscheduler(task, given, os.sched_param(priority))
                    break


def _place(task: int) -> tuple[int, int] | None:
    """Policy and real-time priority of a thread; None: it has ended."""
    try:
        return os.sched_getscheduler(task), os.sched_getparam(task).sched_priority
    except OSError:
        return None


def _schedule(task: int, has: int, priority: int) -> bool:
    """Let a thread have at least a real-time priority; processes and threads it starts have none. Whether it has it."""
    if has >= priority:
        return True
    try:
        os.sched_setscheduler(task, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:  # a right that few have; without it all goes on as it is
        return False
    return True


def _tasks() -> list[int]:
    """Numbers of this process's threads, where the system tells them."""
    folder = Path("/proc/self/task")
    return [int(task.name) for task in folder.iterdir()] if folder.is_dir() else []


ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a run in order; the last comes when a terminal or its connection is closed."""


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
