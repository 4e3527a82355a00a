"""Folders in which machine code may be kept."""

from __future__ import annotations

import os
import stat
import tempfile
from functools import cache
from pathlib import Path


@cache
def private_folder() -> Path | None:
    """A folder for temporary files that nobody but this user can write to; None when there is none.

    What is kept in it is run when it is loaded: a folder that another made, or that others may write to, is not used.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    try:
        folder = Path(tempfile.gettempdir()) / f"steerclear-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        seen = os.lstat(folder)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return None
    if not stat.S_ISDIR(seen.st_mode):
        return None
    shared = hasattr(os, "getuid") and (seen.st_uid != user or seen.st_mode & 0o022)
    return None if shared else folder
