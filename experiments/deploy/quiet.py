"""What keeps a run in time and in order: compiling beforehand, few pauses, signals."""

from __future__ import annotations

import contextlib
import gc
import signal
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict
from types import FrameType
from typing import Any

from steerclear.experiments.warming import compile_shield
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.platforms import fresh_state, step_boat

SWITCH_S = 0.0001
"""How long another thread may keep the interpreter from the loop, s."""


def warm_up(fleet: FleetFile) -> None:
    """Compile all that the loop runs, so that its first turn is as quick as any."""
    compile_shield(asdict(fleet.shield_config))
    for platform in set(fleet.platform_of.values()):
        step_boat(platform.pack(), fresh_state(0.0, 0.0, 0.0), 1.0, 0.0, fleet.dt_s)


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Fewer pauses: what was made so far is not looked through for garbage, and threads hand over quickly."""
    interval = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()


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
