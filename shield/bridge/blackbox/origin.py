"""Where decisions come from: versions, sources and the machine, since all of them may change a last bit."""

from __future__ import annotations

import hashlib
import platform as machine
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ...tables.files import find_table
from ...tables.settings import OtherMay

PACKAGES = ("steerclear", "numpy", "numba", "llvmlite", "qpsolvers", "daqp", "osqp", "quadprog", "pymavlink", "mcap")
"""Distributions whose versions a log notes."""


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of `PACKAGES` as far as they are installed."""
    found = {"python": machine.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def source_digest() -> str:
    """Digest of the shield's sources, the same wherever they are installed."""
    folder = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def table_digests(platforms: Iterable[str]) -> dict[str, str]:
    """Digests of the value table files there are for pairs of platforms, which the shield may look opponents up in.

    Args:
        platforms: names.
    """
    found, names = {}, sorted(platforms)
    for own in names:
        for other in names:
            path = find_table(own, other, OtherMay.WORST_CASE)
            if path is not None:
                found[f"{own} with {other}"] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


@cache
def describe_machine() -> str:
    """Architecture, system, C library and processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = names[0] if names else machine.processor()
    return f"{machine.machine()} {machine.system()} {' '.join(machine.libc_ver())} {processor}".strip()
