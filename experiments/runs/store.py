"""Keeping results on disk while a run goes on, one line of JSON per finished job, and reading them back."""

from __future__ import annotations

import contextlib
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

from .folder_lock import lock_folder
from .provenance import code_digest

LINES_FILE = "games.jsonl"
RESULTS_FILE = "results.json"
BESIDE = ("games.csv", "games.parquet", "report.html", "replay.html", "entry.html")
"""What commands write into a folder beside those two."""
logger = logging.getLogger(__name__)


class ResultStore:
    """An output folder whose ``games.jsonl`` grows by one line per result and survives interruption.

    Only this process writes there while the store lives. A line counts when it is as it was written, by the code that
    runs now; others are left out, and stay in the file.

    Args:
        folder: created when missing.
        resume: read what an earlier run left there instead of refusing to write beside it.
        command: whose results these are, as its results file says; those of another are not gone on with.

    Raises:
        ConfigError: the folder already holds results, or files that they would write over, and ``resume`` is off, or
            others with it, another process writes there, or it cannot be written to.
    """

    def __init__(self, folder: Path, resume: bool = False, command: str | None = None) -> None:
        self.folder = folder
        self.lines = folder / LINES_FILE
        self._told: set[str] = set()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._check(resume, command)  # first, so that nothing is left in a folder that is not ours
            self._lock = lock_folder(folder)
            self._check(resume, command)  # again: another may have been there a moment ago
            self.lines.touch()
        except OSError as error:
            raise ConfigError(f"cannot write to {folder} ({error.strerror}); choose another --out") from error

    def _check(self, resume: bool, command: str | None) -> None:
        for path in (self.lines, self.folder / RESULTS_FILE):
            if path.exists() and not path.is_file():  # a pipe or a device would be read for ever
                raise ConfigError(f"{path} is no plain file; move it away or choose another --out")
        holds = self.lines.exists() and (not self.lines.is_file() or self.lines.stat().st_size > 0)
        if not resume and (holds or (self.folder / RESULTS_FILE).exists()):
            raise ConfigError(f"{self.folder} already holds results; add --resume to continue or choose another --out")
        for name in [] if resume or not self.folder.exists() else BESIDE:
            if (self.folder / name).exists():
                raise ConfigError(f"{self.folder / name} would be written over; choose another --out, or move it")
        if resume and command is not None:
            _check_whose(self.folder / RESULTS_FILE, command)

    def append(self, key: str, result: Mapping[str, Any]) -> None:
        """Add a result under a key; it is on disk when this returns.

        Raises:
            ConfigError: it cannot be written (the disk is full); what was there before stays as it was.
        """
        try:
            with self._lock.writing, self.lines.open("r+b", buffering=0) as file:
                end_last_line(file)
                _append(file, line_of(key, result, code_digest()))
        except OSError as error:
            raise ConfigError(
                f"cannot write {self.lines} ({error.strerror}); what it holds is kept: make room, then --resume"
            ) from error

    def load(self) -> dict[str, dict[str, Any]]:
        """Return every result that counts by key; the last one of a key does.

        Raises:
            ConfigError: the file cannot be read, or is no text.
        """
        try:
            text = self.lines.read_bytes().decode()
        except (OSError, UnicodeDecodeError) as error:
            why = "is no text" if isinstance(error, UnicodeDecodeError) else error.strerror
            raise ConfigError(f"cannot read {self.lines} ({why}); move it away or choose another --out") from error
        found, others = {}, 0
        for number, line in enumerate(text.split("\n"), start=1):
            entry = read_line(line) if line else None
            if entry is None:
                if line:
                    self._tell(f"{self.lines} line {number} is not complete, or not as it was written; it is left out")
            elif entry.pop("code") != code_digest():
                others += 1
            else:
                found[entry.pop("key")] = entry
        if others:
            self._tell(f"{self.lines}: {others} results are of other code or versions, count for nothing here")
        return found

    def _tell(self, words: str) -> None:
        if words not in self._told:
            self._told.add(words)
            logger.warning("%s", words)


def line_of(key: str, result: Mapping[str, Any], code: str) -> bytes:
    """A result as a line: its key, the digest of the code that made it, and one over all of it."""
    entry = json.loads(json.dumps({"key": key, "code": code, **result}, default=_plain))
    return (json.dumps({**entry, "sum": key_of(entry)}) + "\n").encode()


def read_line(line: str) -> dict[str, Any] | None:
    """The entry of a line that is as `line_of` wrote it, with ``key`` and ``code``; None for any other."""
    try:
        entry = json.loads(line)
        if isinstance(entry, dict) and entry.pop("sum", None) == key_of(entry):
            return entry if isinstance(entry.get("key"), str) and "code" in entry else None
    except (ValueError, RecursionError):
        pass
    return None


def _check_whose(results: Path, command: str) -> None:
    """Refuse to go on in a folder whose results are another command's, or nobody's.

    Raises:
        ConfigError: they are.
    """
    if not results.exists():
        return
    try:
        found = json.loads(results.read_text()).get("command")
    except (OSError, ValueError, AttributeError, RecursionError):
        found = None
    if found != command:
        whose = f"of {found!r}" if isinstance(found, str) else "that are not ours"
        raise ConfigError(f"{results.parent} holds results {whose}, not of {command!r}; choose another --out")


def end_last_line(file: Any) -> None:
    """Move to the end of a binary file, where a line begins.

    A last line without its end is ended if it is whole, and dropped if it was cut (the writer was killed).
    """
    end = file.seek(0, os.SEEK_END)
    if end == 0 or _byte_before(file, end) == b"\n":
        return
    file.seek(0)
    begin = file.read().rfind(b"\n") + 1
    file.seek(begin)
    if read_line(file.read().decode(errors="replace")) is None:
        file.truncate(begin)
        file.seek(begin)
    else:
        file.write(b"\n")


def _byte_before(file: Any, place: int) -> bytes:
    file.seek(place - 1)
    return bytes(file.read(1))


def _append(file: Any, line: bytes) -> None:
    """Write a line to the disk whole, or leave the file as it was."""
    begin, left = file.tell(), memoryview(line)
    try:
        while left:
            left = left[file.write(left) :]
        os.fsync(file.fileno())
    except OSError:
        with contextlib.suppress(OSError):
            os.ftruncate(file.fileno(), begin)
        raise


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
    """Write flat rows as Parquet when pyarrow is installed, else as CSV; return the path.

    Raises:
        ConfigError: the file cannot be written.
    """
    ending, write = (".csv", _write_csv) if find_spec("pyarrow") is None else (".parquet", _write_parquet)
    path = folder / f"{stem}{ending}"
    try:
        write(path, rows)
    except OSError as error:
        raise ConfigError(f"cannot write {path} ({error.strerror or error}); choose another place") from error
    return path


def _write_parquet(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    import pyarrow
    from pyarrow import parquet

    columns = list(dict.fromkeys(name for row in rows for name in row))
    parquet.write_table(pyarrow.table({name: [row.get(name) for row in rows] for name in columns}), path)


def _write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)


def told_settings(value: Any) -> Any:
    """Nested settings with infinity as the text inf, as commands take it: JSON has no such number."""
    if isinstance(value, Mapping):
        return {key: told_settings(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [told_settings(item) for item in value]
    return f"{value:g}" if isinstance(value, float) and math.isinf(value) else value


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
