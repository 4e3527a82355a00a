"""Files that are written completely or not at all, and files of arrays that may be missing, cut or damaged."""

from __future__ import annotations

import errno
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import SteerclearError, TraceError

MOST_BYTES = 200 * 2**20
"""Limit for all arrays of a file together, unpacked. Ten hours of three against three boats are a tenth of it."""

Axes = tuple[str | int, ...]
"""Axes of an array: lengths, or names of lengths."""

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
"""Exceptions of numpy for files that are cut, damaged, or hold something else."""


@contextmanager
def whole_file(target: Path, error: type[SteerclearError]) -> Iterator[Path]:
    """Write to a file beside the target and move it there once it is complete.

    Args:
        target: File to write; its folder is created. An older file stays until the new one is complete.
        error: Raised when the file cannot be written.

    Yields:
        The file to write to, with the target's ending.

    Raises:
        SteerclearError: Of the class ``error``.
    """
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        os.replace(part, target)
    except OSError as problem:
        remedy = "Free space on that disk" if problem.errno == errno.ENOSPC else "Choose a folder you may write to"
        raise error(f"cannot write {target} ({problem}). {remedy}.") from problem
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def save_arrays(target: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an ``.npz`` file, completely or not at all."""
    with whole_file(target, TraceError) as part, part.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def read_arrays(path: str | os.PathLike[str], what: str, remedy: str) -> dict[str, np.ndarray]:
    """Read all arrays of an ``.npz`` file; only plain data is ever loaded.

    Args:
        path: the file.
        what: what the file should be, for error messages.
        remedy: the end of error messages.

    Raises:
        TraceError: the file is missing, cut or of another kind.
    """
    source = Path(path)
    if source.is_dir():
        raise TraceError(f"{source} is a folder; name a {what} in it (.npz)")
    if not source.is_file():
        raise TraceError(f"there is no {what} {source}; check the path. {remedy}")
    if not zipfile.is_zipfile(source):  # numpy would take it for a pickle and advise to trust it
        raise TraceError(f"{source} is cut or not a {what}. {remedy}")
    try:
        with source.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            _check_sizes(archive.zip)
            return {name: archive[name] for name in archive.files}
    except _UNREADABLE as error:
        raise TraceError(f"{source} is cut or not a {what} ({error}). {remedy}") from error


def _check_sizes(archive: zipfile.ZipFile) -> None:
    """Refuse arrays that claim to be larger than their file, or are too large together, before memory is allocated."""
    total = sum(entry.file_size for entry in archive.infolist())
    if total > MOST_BYTES:
        raise ValueError(f"it unpacks to {total / 2**20:.0f} MiB, at most {MOST_BYTES / 2**20:.0f} are read")
    for entry in archive.infolist():
        with archive.open(entry) as stream:
            old = np.lib.format.read_magic(stream) == (1, 0)
            read = np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0
            shape, _, kind = read(stream)
        if math.prod(shape) * kind.itemsize > entry.file_size:
            raise ValueError(f"{entry.filename} is shorter than it says")


def check_shapes(
    arrays: Mapping[str, np.ndarray], layout: Mapping[str, Axes], sizes: Mapping[str, int], whose: str, remedy: str
) -> None:
    """Raise a `TraceError`, from ``whose`` to the remedy, if arrays lack the axes of a layout with these sizes."""
    for name, axes in layout.items():
        want = tuple(axis if isinstance(axis, int) else sizes[axis] for axis in axes)
        if arrays[name].shape != want:
            raise TraceError(f"{whose}{name} has shape {arrays[name].shape}, expected {want}. {remedy}")


def check_finite(arrays: Mapping[str, Any], names: tuple[str, ...], whose: str, remedy: str) -> None:
    """Raise a `TraceError`, from ``whose`` to the remedy, if an array is not finite."""
    for name in names:
        if not np.isfinite(arrays[name]).all():
            raise TraceError(f"{whose}{name} holds NaN or infinity. {remedy}")
