"""Reading files of arrays that may be missing, cut, damaged or something else."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
from steerclear.shield.exceptions import TraceError

_UNREADABLE = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    AttributeError,
    TypeError,
    NotImplementedError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""What numpy raises on files that are cut, damaged, or hold something else."""


def read_arrays(path: str | os.PathLike[str], what: str, remedy: str) -> dict[str, np.ndarray]:
    """Read all arrays of an ``.npz`` file; nothing that is not plain data is ever loaded.

    Args:
        path: the file.
        what: what it should be, for messages.
        remedy: sentence that says how to get a whole one.

    Raises:
        TraceError: the file is missing, cut or no such file.
    """
    source = Path(path)
    if source.is_dir():
        raise TraceError(f"{source} is a folder; name a {what} in it (.npz)")
    if not source.is_file():
        raise TraceError(f"there is no {what} {source}; check the path, or record a game first")
    if not zipfile.is_zipfile(source):  # numpy would take it for a pickle and advise to trust it
        raise TraceError(f"{source} is cut or not a {what}. {remedy}")
    try:
        with source.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except _UNREADABLE as error:
        raise TraceError(f"{source} is cut or not a {what} ({error}). {remedy}") from error
