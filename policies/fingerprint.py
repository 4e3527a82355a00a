"""Fingerprints that tell whether a policy's files have changed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from steerclear.shield.exceptions import PolicyError

from .entrants import entrants
from .own import file_of, own_code
from .registry import SB3_PREFIX, WEIGHTS_PREFIX, names

NO_PART = ("rows.jsonl", "games.jsonl", "pyvenv.cfg")
"""Files that mark folders of results (also of 0.8.0 and before) and virtual environments; these are no part of a
policy.
"""


def fingerprint(name_or_path: str | Path) -> str:
    """Return a fingerprint of a policy's files; it changes with their content and names.

    Hidden files and folders, ``__pycache__``, folders of results and virtual environments do not count.

    Args:
        name_or_path: as for `make`. For a ``solution.py`` its whole folder counts, for your own file only the file.

    Returns:
        16 hexadecimal digits; empty for our named policies and where there is no file.

    Raises:
        PolicyError: a file cannot be read.
    """
    text = str(name_or_path)
    own = own_code(text)
    path = Path(text.removeprefix(SB3_PREFIX).removeprefix(WEIGHTS_PREFIX)).expanduser()
    if own is not None:
        path = file_of(own[0]) or path
    if text in entrants():
        return entrants()[text].files()
    if text in names() or not path.exists():
        return ""
    alone = (
        own is not None or text.startswith((SB3_PREFIX, WEIGHTS_PREFIX)) or (path.is_file() and path.suffix != ".py")
    )
    folder = path if path.is_dir() else path.parent
    try:
        return _digest(folder, [path] if alone else sorted(_files(folder, set())))
    except OSError as error:
        raise PolicyError(f"policy {text}: {error.filename} cannot be read ({error.strerror})") from error


def _files(folder: Path, seen: set[Path]) -> Iterator[Path]:
    """Yield the files that count, also behind links to folders; each folder once."""
    if folder.resolve() in seen:
        return
    seen.add(folder.resolve())
    for entry in os.scandir(folder):
        path = Path(entry.path)
        if entry.name.startswith(".") or entry.name == "__pycache__":
            continue
        if not entry.is_dir():
            if entry.is_file() or entry.is_symlink():  # skip pipes and sockets: reading one may never end
                yield path
        elif not any((path / name).exists() for name in NO_PART):
            yield from _files(path, seen)


def _digest(folder: Path, files: list[Path]) -> str:
    digest = hashlib.sha256()
    for path in files:
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(folder).as_posix()} {content}\n".encode())
    return digest.hexdigest()[:16]
