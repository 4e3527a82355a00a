"""How well the loop keeps its rate: a sink that counts, and never grows."""

from __future__ import annotations

import numpy as np

from .tick import Tick

BIN_S = 0.0001
"""Width of a bin, s."""

BINS = 20_000


class _Histogram:
    """Counts of durations, in bins of `BIN_S`; longer ones than it has bins go into the last."""

    def __init__(self) -> None:
        self.counts = np.zeros(BINS, np.int64)
        self.longest_s = 0.0

    def add(self, duration_s: float) -> None:
        self.counts[min(BINS - 1, max(0, int(duration_s / BIN_S)))] += 1
        self.longest_s = max(self.longest_s, duration_s)

    def quantile_s(self, share: float) -> float:
        """Upper edge of the bin that this share of durations does not exceed, s."""
        total = np.cumsum(self.counts)
        if total[-1] == 0:
            return 0.0
        return min(float(np.searchsorted(total, share * total[-1]) + 1) * BIN_S, self.longest_s)


class Timing:
    """A sink that measures the loop's jitter and the time from telemetry to command."""

    def __init__(self) -> None:
        self._late = _Histogram()
        self._turn = _Histogram()
        self._decide = _Histogram()

    def take(self, tick: Tick) -> None:
        """Count one tick."""
        self._late.add(tick.began_s - tick.due_s)
        self._turn.add(tick.sent_s - tick.began_s)
        if tick.decisions is not None:
            self._decide.add(tick.decisions.solve_time_s)

    def close(self) -> None:
        """Nothing to finish."""

    def figures(self) -> dict[str, float]:
        """Jitter (begin after due), telemetry read to last command sent, and the decision alone, s."""
        return {
            "jitter_p50_s": self._late.quantile_s(0.5),
            "jitter_p999_s": self._late.quantile_s(0.999),
            "jitter_max_s": self._late.longest_s,
            "read_to_sent_p50_s": self._turn.quantile_s(0.5),
            "read_to_sent_p99_s": self._turn.quantile_s(0.99),
            "read_to_sent_max_s": self._turn.longest_s,
            "decide_p99_s": self._decide.quantile_s(0.99),
        }
