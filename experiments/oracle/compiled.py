"""The one way the oracle's functions are compiled."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


@cache
def _stamp() -> tuple[str, int]:
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest(), len(files)


def compiled(function: F) -> F:
    """Compile with numba, cached on disk; IEEE division, no fast-math.

    numba renews its cache only when the function's own file changes. These functions are compiled into one another
    across files, so the stamp it compares covers the whole folder.
    """
    dispatcher = njit(cache=True, nogil=True, error_model="numpy")(function)
    cache_file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if hasattr(cache_file, "_source_stamp"):
        cache_file._source_stamp = _stamp()
    return cast(F, dispatcher)
