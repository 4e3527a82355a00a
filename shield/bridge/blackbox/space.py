"""Is there room for the log? A check before boats move."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from pathlib import Path

from ..preflight.result import CheckResult
from .disk import explain

BYTES_PER_BOAT_S = 6_000.0
"""Generous size of the log per boat and second at 10 Hz: MCAP and tlog together."""
SLOWEST_SYNC_S = 0.5
"""A disk that takes longer than this to keep a second of log cannot hold it at most 1 s behind."""
_CHUNK = 64 * 1024


def check_disk(folder: Path, *, boats: int, minutes: float = 120.0, name: str = "disk") -> CheckResult:
    """Check that logs can be written, fast enough and for long enough.

    Args:
        folder: where logs go; made when missing.
        boats: in the fleet.
        minutes: how long must fit.
        name: of the check.
    """
    needed = boats * minutes * 60.0 * BYTES_PER_BOAT_S
    try:
        folder.mkdir(parents=True, exist_ok=True)
        sync_s = _time_sync(folder)
        free = float(shutil.disk_usage(folder).free)
    except OSError as error:
        return CheckResult(name, False, f"{folder}: {explain(error)}")
    figures = {"free_mib": free / 2**20, "needed_mib": needed / 2**20, "sync_s": sync_s}
    if free < needed:
        text = f"{folder}: {free / 2**20:.0f} MiB free, {needed / 2**20:.0f} MiB needed for {minutes:g} min; free space"
        return CheckResult(name, False, text, figures)
    if sync_s > SLOWEST_SYNC_S:
        text = f"{folder}: the disk takes {sync_s:.1f} s to keep 64 KiB; set log_dir to a faster one"
        return CheckResult(name, False, text, figures)
    text = f"{folder}: {free / 2**20:.0f} MiB free, {needed / 2**20:.0f} MiB needed for {minutes:g} min"
    return CheckResult(name, True, text, figures)


def _time_sync(folder: Path) -> float:
    """Time the disk takes to keep a second's worth of log, s; the file is gone afterwards."""
    with tempfile.TemporaryFile(dir=folder) as file:
        started = time.monotonic()
        file.write(os.urandom(_CHUNK))
        file.flush()
        os.fsync(file.fileno())
        return time.monotonic() - started
