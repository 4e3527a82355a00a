"""The one way the oracle's functions are compiled."""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit
from numba.core.caching import FunctionCache

logger = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., Any])


@cache
def _stamp() -> tuple[str, int]:
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest(), len(files)


class _Kept(FunctionCache):
    """numba's cache on disk, without which functions are compiled all the same.

    Files that cannot be read, of a power cut or another user, are written anew; a disk that is full keeps nothing.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code of a signature, None when it must be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # what damage leads to is anything
            logger.warning("compiled code in %s cannot be read, it is made anew (%r)", self.cache_path, error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code of a signature."""
        try:
            super().save_overload(sig, data)
        except Exception:  # the index is one of the files that cannot be read, or nothing can be written
            with contextlib.suppress(OSError):
                self.flush()
                super().save_overload(sig, data)


def compiled(function: F) -> F:
    """Compile with numba, cached on disk where that can be; IEEE division, no fast-math.

    numba renews its cache only when the function's own file changes. These functions are compiled into one another
    across files, so the stamp it compares covers the whole folder.
    """
    dispatcher: Any = njit(nogil=True, error_model="numpy")(function)
    with contextlib.suppress(RuntimeError, OSError):  # no folder can be written to: compiled at every start
        kept = _Kept(function)
        kept._cache_file._source_stamp = _stamp()
        dispatcher._cache = kept
    return cast(F, dispatcher)
