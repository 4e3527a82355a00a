"""Telling whether a policy's files are still the same."""

from __future__ import annotations

import hashlib
from pathlib import Path

from .registry import SB3_PREFIX, names

SUFFIXES = {".py", ".zip", ".pt", ".pth", ".pkl", ".npz", ".npy", ".onnx", ".safetensors"}
"""What code and weights are kept in. Other files of a folder (logs, videos, settings of an editor) come and go."""
NOT_OF_IT = {"__pycache__", "results"}
"""Folders that running a policy fills."""


def fingerprint(name_or_path: str | Path) -> str:
    """Digest of the code and weights of a policy from a file: other content, other digest.

    Args:
        name_or_path: as for `make`; of a ``solution.py`` all the folder it lies in counts.

    Returns:
        16 hexadecimal digits; empty for the named policies and where there is no file.
    """
    text = str(name_or_path)
    path = Path(text.removeprefix(SB3_PREFIX)).expanduser()
    if text in names() or not path.exists():
        return ""
    if text.startswith(SB3_PREFIX) or (path.is_file() and path.suffix != ".py"):
        return _digest(path.parent, [path])
    folder = path if path.is_dir() else path.parent
    return _digest(folder, sorted(file for file in folder.rglob("*") if _counts(file.relative_to(folder), file)))


def _counts(inside: Path, file: Path) -> bool:
    left_out = any(part in NOT_OF_IT or part.startswith(".") for part in inside.parts)
    return not left_out and file.suffix in SUFFIXES and file.is_file()


def _digest(folder: Path, files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        content = hashlib.sha256(file.read_bytes()).hexdigest()
        digest.update(f"{file.relative_to(folder).as_posix()} {content}\n".encode())
    return digest.hexdigest()[:16]
