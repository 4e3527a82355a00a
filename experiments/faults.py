"""What is said of errors that nobody foresaw: one line, and the traceback in a file for whoever mends it."""

from __future__ import annotations

import errno
import sys
import tempfile
import traceback

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
    name = " ".join(f"{type(error).__name__}: {error}".split())
    return f"error: this is a fault of steerclear, not of yours ({name[:200]}); {_kept(error)}"


def _kept(error: Exception) -> str:
    lines = ["".join(traceback.format_exception(error)), f"steerclear {package_version()}, Python {sys.version}"]
    lines.append(f"command: {sys.argv!r}")
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="steerclear-fault-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write("\n".join(lines))
    except OSError as problem:
        return f"its traceback could not be written ({problem.strerror})"
    return f"its traceback is in {file.name}: please report it"
