"""Compiled functions of the experiments: as the shield's, with the sources beside them in the cache's stamp too."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from steerclear.shield import jit

F = TypeVar("F", bound=Callable[..., Any])
FOLDERS = ("encounters", "baselines/reach_guard", "baselines/textbook", "measure")
"""Folders whose compiled functions or constants are used elsewhere; a function's own folder always counts."""


def digest_of(folders: set[Path]) -> str:
    """Digest of the sources in some folders: other text, other digest."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in folders for path in folder.glob("*.py")):
        digest.update(str(path).encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def _digest_beside(folder: Path) -> str:
    return digest_of({folder, *(Path(__file__).parent / name for name in FOLDERS)})


def kernel(function: F) -> F:
    """Compile as `steerclear.shield.jit.kernel` does; a changed callee beside it or in `FOLDERS` is never run stale."""
    compiled = jit.kernel(function)
    kept = compiled._cache
    kept.stamp = (*kept.stamp, _digest_beside(Path(function.__code__.co_filename).parent))
    return compiled
