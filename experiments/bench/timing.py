"""Timing helpers: quantiles over calls, memory."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"p50_us": 0.5, "p99_us": 0.99, "p99_9_us": 0.999}


def time_calls(call: Callable[[int], Any], times: int) -> NDArray[np.float64]:
    """Time ``call(0)``, ``call(1)``, ...: (times,) in us."""
    spent = np.zeros(times)
    for k in range(times):
        begin = time.perf_counter_ns()
        call(k)
        spent[k] = time.perf_counter_ns() - begin
    return spent / 1000.0


def quantiles_us(repeats: Sequence[NDArray[np.float64]]) -> dict[str, float | None]:
    """Quantiles over calls, each call counting with the median of its repeats; None without calls.

    The calls compute the same thing in every repeat, so that the median leaves out what other processes of the
    machine did to single ones.
    """
    if not repeats or not len(repeats[0]):
        return dict.fromkeys(QUANTILES)
    times = np.median(np.stack(repeats), axis=0)
    return {name: float(np.quantile(times, share)) for name, share in QUANTILES.items()}


def memory_mib(make: Callable[[], Any]) -> float:
    """Memory that the object ``make()`` builds holds, MiB; numpy reports its arrays to tracemalloc."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        made = make()
        held = tracemalloc.get_traced_memory()[0] - before
        del made
    finally:
        tracemalloc.stop()
    return held / 2**20
