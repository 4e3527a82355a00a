"""Clocks of the loop: monotonic only, so that a step of the wall clock changes nothing; time asleep counts."""

from __future__ import annotations

import time
from typing import Protocol

from ..exceptions import ConfigError


class Clock(Protocol):
    """Seconds that only go forward. All times and ages in `bridge` are of one clock."""

    def now_s(self) -> float:
        """Time now, s, from an arbitrary start."""

    def sleep_until(self, time_s: float) -> None:
        """Return at that time, at once if it is past."""


def machine_s() -> float:
    """Monotonic time of the machine, s. Time that a computer spends asleep counts: what was known before is old."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)  # Linux, whose `time.monotonic` stands still meanwhile
    return time.monotonic() if boot is None else time.clock_gettime(boot)


class MonotonicClock:
    """The machine's monotonic clock, optionally faster, for simulated boats that run faster than real time.

    Args:
        speed: seconds of this clock per second of the machine.

    Raises:
        ConfigError: ``speed`` is not a number > 0.
    """

    def __init__(self, speed: float = 1.0) -> None:
        if not 0.0 < speed < 1e6:
            raise ConfigError(f"speed is {speed}; give a number > 0, 1 for real time")
        self.speed = float(speed)

    def now_s(self) -> float:
        """Monotonic time times ``speed``, s."""
        return machine_s() * self.speed

    def sleep_until(self, time_s: float) -> None:
        """Sleep to that time of this clock."""
        wait = time_s / self.speed - machine_s()
        if wait > 0.0:
            time.sleep(wait)


class ManualClock:
    """A clock that moves only when told: for tests and replays."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now = float(start_s)

    def now_s(self) -> float:
        """The time it was last moved to, s."""
        return self._now

    def sleep_until(self, time_s: float) -> None:
        """Move there."""
        self._now = max(self._now, float(time_s))
