"""Where and with what results were made: versions, machine."""

from __future__ import annotations

import hashlib
import os
import platform
import time
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("steerclear", "numpy", "scipy", "numba", "qpsolvers", "daqp", "osqp", "gymnasium", "pettingzoo", "torch")
SOURCES = ("*.py", "*.npz", "shipped/*.yaml")
"""Code, tables and weights, boats."""
NO_GAME = (
    "shield/bridge/",
    "env/render/",
    "experiments/sim_boats/",
    *(f"experiments/{name}.py" for name in ("docs", "markdown", "page", "plots")),
    *(f"experiments/{name}.py" for name in ("report", "replay_html", "tables", "terminal", "words")),
    *(f"experiments/{name}" for name in ("cli", "console")),
)
"""How the names of files begin whose code changes no result that is kept on disk."""


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def code_digest() -> str:
    """Digest of what results depend on beside their settings: our sources and tables, versions of the packages."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(str(sorted(versions().items())).encode())
    for folder in ("shield", "env", "policies", "experiments"):
        for path in sorted(path for ending in SOURCES for path in (root / folder).rglob(ending)):
            name = path.relative_to(root).as_posix()
            if not name.startswith(NO_GAME):
                digest.update(name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def package_version(name: str = "steerclear") -> str | None:
    """Return the installed version of a distribution, None where it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def versions() -> dict[str, str | None]:
    """Return the versions that results depend on, Python's first."""
    return {"python": platform.python_version(), **{name: package_version(name) for name in PACKAGES}}


def machine() -> dict[str, Any]:
    """Describe the machine: processor, cores this process may use, memory in GiB, system."""
    return {
        "processor": _processor(),
        "cores": available_cores(),
        "memory_gib": _memory_gib(),
        "system": f"{platform.system()} {platform.release()}",
    }


def head_of(command: str, settings: Mapping[str, Any], started_s: float) -> dict[str, Any]:
    """What JSON of a command begins with; ``started_s``: when it began, by `time.perf_counter`."""
    head = {"command": command, "settings": dict(settings), "versions": versions(), "machine": machine()}
    return {**head, "wall_s": time.perf_counter() - started_s}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _memory_gib() -> float | None:
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1)
    except (AttributeError, ValueError, OSError):
        return None
