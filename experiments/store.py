"""Keeping results on disk while a run goes on, one line of JSON per finished job, and reading them back."""

from __future__ import annotations

import csv
import hashlib
import json
import logging
import math
import os
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError

LINES_FILE = "games.jsonl"
RESULTS_FILE = "results.json"
logger = logging.getLogger(__name__)


class ResultStore:
    """An output folder whose ``games.jsonl`` grows by one line per result and survives interruption.

    Args:
        folder: created when missing.
        resume: read what an earlier run left there instead of refusing to write beside it.
        command: whose results these are, as its results file says; those of another are not gone on with.

    Raises:
        ConfigError: the folder already holds results and ``resume`` is off, or others with it, or it cannot be written
            to.
    """

    def __init__(self, folder: Path, resume: bool = False, command: str | None = None) -> None:
        self.folder = folder
        self.lines = folder / LINES_FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            holds = self.lines.exists() and (not self.lines.is_file() or self.lines.stat().st_size > 0)
            if not resume and (holds or (folder / RESULTS_FILE).exists()):
                raise ConfigError(f"{folder} already holds results; add --resume to continue or choose another --out")
            if resume and command is not None:
                _check_whose(folder / RESULTS_FILE, command)
            self.lines.touch()
        except OSError as error:
            raise ConfigError(f"cannot write to {folder} ({error.strerror}); choose another --out") from error

    def append(self, key: str, result: Mapping[str, Any]) -> None:
        """Add a result under a key; it is on disk when this returns."""
        with self.lines.open("r+b") as file:
            cut_unfinished_line(file)
            file.write((json.dumps({"key": key, **result}, default=_plain) + "\n").encode())
            file.flush()
            os.fsync(file.fileno())

    def load(self) -> dict[str, dict[str, Any]]:
        """Return every complete result by key; the last one of a key counts, a cut last line is left out.

        Raises:
            ConfigError: the file cannot be read, or is no text.
        """
        try:
            text = self.lines.read_text()
        except (OSError, UnicodeDecodeError) as error:
            why = "is no text" if isinstance(error, UnicodeDecodeError) else error.strerror
            raise ConfigError(f"cannot read {self.lines} ({why}); move it away or choose another --out") from error
        found = {}
        for number, line in enumerate(text.splitlines(), start=1):
            try:
                entry = json.loads(line)
                found[entry.pop("key")] = entry
            except (json.JSONDecodeError, KeyError, AttributeError):
                logger.warning("%s line %d is not complete and is left out", self.lines, number)
        return found


def _check_whose(results: Path, command: str) -> None:
    """Refuse to go on in a folder whose results are another command's, or nobody's.

    Raises:
        ConfigError: they are.
    """
    if not results.exists():
        return
    try:
        found = json.loads(results.read_text()).get("command")
    except (OSError, ValueError, AttributeError):
        found = None
    if found != command:
        whose = f"of {found!r}" if isinstance(found, str) else "that are not ours"
        raise ConfigError(f"{results.parent} holds results {whose}, not of {command!r}; choose another --out")


def cut_unfinished_line(file: Any) -> None:
    """Move to the end of a binary file, dropping a last line that has no line end (the writer was killed)."""
    end = file.seek(0, os.SEEK_END)
    if end == 0:
        return
    file.seek(0)
    keep = file.read().rfind(b"\n") + 1
    file.truncate(keep)
    file.seek(keep)


def key_of(settings: Mapping[str, Any]) -> str:
    """Return a short name for settings: the same settings always give the same key, in any order."""
    text = json.dumps(settings, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON that every reader takes: not-a-number becomes null; the file appears whole or not at all.

    Raises:
        ConfigError: the file cannot be written.
    """
    text = json.dumps(finite(content), indent=2, default=_plain, allow_nan=False)
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text + "\n", encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        raise ConfigError(f"cannot write {path} ({error.strerror}); choose another place") from error


def write_table(folder: Path, rows: Sequence[Mapping[str, Any]], stem: str = "games") -> Path:
    """Write flat rows as Parquet when pyarrow is installed, else as CSV; return the path."""
    if find_spec("pyarrow") is None:
        return _write_csv(folder / f"{stem}.csv", rows)
    import pyarrow
    from pyarrow import parquet

    path = folder / f"{stem}.parquet"
    columns = list(dict.fromkeys(name for row in rows for name in row))
    parquet.write_table(pyarrow.table({name: [row.get(name) for row in rows] for name in columns}), path)
    return path


def _write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    return path


def finite(value: Any) -> Any:
    """Replace every NaN and infinity in nested data by None."""
    value = _plain(value) if hasattr(value, "tolist") else value
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"cannot write a {type(value).__name__} as JSON")
