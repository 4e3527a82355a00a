"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from steerclear.shield.exceptions import SteerclearError


@contextmanager
def whole_file(target: Path, error: type[SteerclearError]) -> Iterator[Path]:
    """Write to a file beside the target and move it there once it is complete.

    Args:
        target: File to write; its folder is created, an older file stays until the new one is complete.
        error: Raised when the file cannot be written.

    Yields:
        The file to write to, with the target's ending.

    Raises:
        SteerclearError: Of the class given.
    """
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        os.replace(part, target)
    except OSError as problem:
        raise error(f"cannot write {target} ({problem}). Choose a folder you may write to.") from problem
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
