"""What keeps a run in time and in order: compiling beforehand, few pauses, signals."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from types import FrameType
from typing import Any

from steerclear.experiments.warming import compile_shield
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.platforms import fresh_state, step_boat

NICENESS = -10
"""Of the runner's threads while boats are steered, where the system allows that and no more."""

LOOP_FIRST, OTHERS_FIRST = 2, 1
"""Real-time priorities of the loop's thread and of the runner's others, where the system allows them: before all other
programs. A nicer program still makes the loop wait for its turn, 18 ms at the load where this makes it 0.2 ms."""

SWITCH_S = 0.0001
"""How long another thread may keep the interpreter from the loop, s."""


def warm_up(fleet: FleetFile) -> None:
    """Compile all that the loop runs, so that its first turn is as quick as any."""
    compile_shield(asdict(fleet.shield_config))
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

    The calling thread goes before the others of this process.
    """
    niceness = os.getpriority(os.PRIO_PROCESS, 0) if hasattr(os, "getpriority") else 0
    own = threading.get_native_id()
    with contextlib.suppress(OSError):  # each takes a right that few have; without it all goes on as it is
        for task in _tasks():
            os.setpriority(os.PRIO_PROCESS, task, NICENESS)
    with contextlib.suppress(OSError):
        for task in _tasks():
            _schedule(task, LOOP_FIRST if task == own else OTHERS_FIRST)
    try:
        yield
    finally:
        for task in _tasks():
            with contextlib.suppress(OSError):
                _schedule(task, 0)
                os.setpriority(os.PRIO_PROCESS, task, niceness)


def _tasks() -> list[int]:
    """Numbers of this process's threads, where the system tells them."""
    folder = Path("/proc/self/task")
    return [int(task.name) for task in folder.iterdir()] if folder.is_dir() else []


def _schedule(task: int, priority: int) -> None:
    """Give a thread a real-time priority, 0: none; processes and threads it starts have none."""
    policy = (os.SCHED_RR if priority else os.SCHED_OTHER) | os.SCHED_RESET_ON_FORK
    os.sched_setscheduler(task, policy, os.sched_param(priority))


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
