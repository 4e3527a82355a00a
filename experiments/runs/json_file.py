"""Reading JSON that may be cut, of another kind, or made to fill the memory."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

MOST_BYTES = 256 * 2**20
"""Larger files are none of ours."""


def read_json(path: Path, what: str, remedy: str) -> Any:
    """Content of a JSON file.

    Args:
        path: the file.
        what: what it should hold, for messages.
        remedy: what to give instead.

    Raises:
        ConfigError: it cannot be read, is too large, or is no JSON.
    """
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise ValueError(f"{size / 2**20:.0f} MiB, at most {MOST_BYTES / 2**20:.0f} are read")
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError, MemoryError) as error:
        raise ConfigError(f"cannot read {what} from {path} ({_words(error)}); {remedy}") from error


def _words(error: BaseException) -> str:
    if isinstance(error, RecursionError):
        return "it is nested too deep"
    if isinstance(error, OSError):
        return error.strerror or type(error).__name__
    return " ".join(str(error).split()) or type(error).__name__
