"""Reading files of arrays that may be missing, cut, damaged or something else."""

from __future__ import annotations

import math
import os
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from steerclear.shield.exceptions import TraceError

MOST_BYTES = 200 * 2**20
"""Of all arrays of a file together, unpacked; ten hours of three against three are a tenth of it."""

_UNREADABLE = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    AttributeError,
    TypeError,
    NotImplementedError,
    RuntimeError,  # an encrypted member, or one nested too deep
    OverflowError,
    SyntaxError,
    MemoryError,
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
            _check_sizes(archive.zip)
            return {name: archive[name] for name in archive.files}
    except _UNREADABLE as error:
        raise TraceError(f"{source} is cut or not a {what} ({error}). {remedy}") from error


def _check_sizes(archive: zipfile.ZipFile) -> None:
    """Refuse arrays that say they are larger than their file, or too large together, before room is made for them.

    Raises:
        ValueError: there are some.
    """
    total = sum(entry.file_size for entry in archive.infolist())
    if total > MOST_BYTES:
        raise ValueError(f"it unpacks to {total / 2**20:.0f} MiB, at most {MOST_BYTES / 2**20:.0f} are read")
    for entry in archive.infolist():
        with archive.open(entry) as stream:
            shape, _, kind = _header(stream)
            if math.prod(shape) * kind.itemsize > entry.file_size:
                raise ValueError(f"{entry.filename} is shorter than it says")


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and type of an array, as its file says."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(stream)
