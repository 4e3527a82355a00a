"""Progress where there is no terminal to draw a bar on: a plain line now and then, fit for a log."""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.console import Console

EVERY_S = 30.0
"""Time between two lines, s."""


class PlainProgress:
    """Prints how much is done, and about how long the rest takes, at most one line in `EVERY_S`.

    Args:
        words: what is done.
        total: how much there is.
        console: where lines go.
        at_once: the first that is told is printed, too, so that a long command is seen to have begun.
        clock: seconds that never go back.
    """

    def __init__(
        self,
        words: str,
        total: int,
        console: Console,
        at_once: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._words, self._total, self._console, self._clock = words, total, console, clock
        self._began_s = clock()
        self._next_s = self._began_s + (0.0 if at_once else EVERY_S)
        self._before: int | None = None

    def __call__(self, done: int, words: str = "") -> None:
        """Tell that so many are done in all; those told first may be an earlier run's and say nothing of the rate."""
        now_s = self._clock()
        if self._before is None:
            self._before = done
        if now_s < self._next_s:
            return
        self._next_s = now_s + EVERY_S
        parts = [f"{self._words}: {done:,} of {self._total:,}", words, self._left(done, now_s - self._began_s)]
        self._console.print(", ".join(part for part in parts if part), markup=False, soft_wrap=True)

    def _left(self, done: int, spent_s: float) -> str:
        made = done - (self._before or 0)
        if made <= 0 or done >= self._total:
            return ""
        return f"about {time_words((self._total - done) * spent_s / made)} left"


def time_words(time_s: float) -> str:
    """A time to read: 40 s, 12 min, 3 h 5 min."""
    if time_s < 90.0:
        return f"{time_s:.0f} s"
    minutes = round(time_s / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"
