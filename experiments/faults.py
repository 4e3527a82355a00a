"""What is said of errors that nobody foresaw: one line, and the traceback in a file for whoever mends it."""

from __future__ import annotations

import errno
import sys
import tempfile
import traceback
from functools import lru_cache

from .provenance import package_version

MACHINE = {
    errno.ENOSPC: "free some space, or write elsewhere",
    errno.EDQUOT: "free some space, or write elsewhere",
    errno.EROFS: "write elsewhere",
    errno.EACCES: "give yourself the right to it, or name another place",
    errno.EPERM: "give yourself the right to it, or name another place",
    errno.ENOENT: "name a place that is there",
    errno.ENOTDIR: "name another place",
    errno.EISDIR: "name a file",
    errno.ENAMETOOLONG: "give a shorter name",
    errno.EMFILE: "raise the limit on open files (ulimit -n)",
    errno.ENFILE: "close other programs",
    errno.EIO: "look after that disk",
}
"""What a machine may refuse, with what helps."""


def machine_words(error: Exception) -> str:
    """Words for what the machine refused; empty when the error is none of its own."""
    if isinstance(error, MemoryError):
        return "there is not enough memory; do less at once (fewer --jobs, shorter games), or give it more"
    if isinstance(error, OSError) and error.errno in MACHINE:
        place = f" ({error.filename})" if error.filename else ""
        return f"{error.strerror}{place}; {MACHINE[error.errno]}"
    return ""


def fault_words(error: Exception) -> str:
    """One line that says this is a fault of steerclear, and where its traceback was written."""
    return words_of_trace(name_of(error), trace_of(error))


def name_of(error: Exception) -> str:
    """What an error says, on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def trace_of(error: Exception) -> str:
    """Its traceback as text, which goes from process to process."""
    return "".join(traceback.format_exception(error))


@lru_cache(maxsize=64)
def words_of_trace(name: str, trace: str) -> str:
    """As `fault_words`, of an error of another process; a file for all jobs that end in the same."""
    return f"this is a fault of steerclear, not of yours ({name}); {_kept(trace)}"


def _kept(trace: str) -> str:
    lines = [trace, f"steerclear {package_version()}, Python {sys.version}", f"command: {sys.argv!r}"]
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="steerclear-fault-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write("\n".join(lines))
    except OSError as problem:
        return f"its traceback could not be written ({problem.strerror})"
    return f"its traceback is in {file.name}: please report it"
