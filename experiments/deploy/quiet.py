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
"""Of the runner's threads while boats are steered, where the system allows it."""

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
    before = _put_before_others(NICENESS)
    try:
        yield
    finally:
        _put_before_others(before)
        sys.setswitchinterval(interval)
        gc.unfreeze()


def _put_before_others(niceness: int) -> int:
    """Give all threads of this process a niceness, where the system lets us; processes started later have none of it.

    Returns:
        The niceness before.
    """
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        return 0
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(OSError):  # it takes a right that few have; without it all goes on as it is
        os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
        for task in tasks.iterdir():
            os.setpriority(os.PRIO_PROCESS, int(task.name), niceness)
    return before


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
