"""Files of results: JSON that every reader takes, tables, and names that are free."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.renamed import earlier_keys

MOST_BYTES = 256 * 2**20
"""Larger JSON files are none of ours."""
NEW = "new file"
"""In an option's ``Annotated``: the command writes that file, and is refused a name that is taken."""


def check_new(path: Path | None, option: str) -> None:
    """Refuse (ConfigError) a name that something has: what a person made, learned or measured is not written over."""
    if path is not None and path.is_dir():
        raise ConfigError(f"{option} {path} is a folder; name a file in it")
    if path is not None and (path.exists() or path.is_symlink()):
        raise ConfigError(f"{path} is there already; name another {option}, or remove it")


def check_place(path: Path | None, option: str) -> None:
    """Find out (ConfigError) before hours of work that the nearest folder that is there takes no file."""
    if path is None:
        return
    try:
        TemporaryFile(dir=next(folder for folder in path.absolute().parents if folder.exists())).close()
    except OSError as error:
        raise ConfigError(f"{option} {path} cannot be written ({error.strerror}); name a file elsewhere") from error


def make_folder_of(path: Path) -> None:
    """Make the folders that a file to be written lies in; OSError where one cannot be made."""
    path.parent.mkdir(parents=True, exist_ok=True)


@contextmanager
def writing(what: str, remedy: str = "choose another place") -> Iterator[None]:
    """Say what could not be written, why, and what to do (ConfigError), where the system refuses it."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"cannot write {what} ({error.strerror or error}); {remedy}") from error


def make_folder(folder: Path) -> None:
    """Make a folder that results go to; ConfigError where it cannot be made."""
    with writing(f"to {folder}", "choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)


def write_new(path: Path, option: str, text: str) -> None:
    """Write a text file that is not there yet, and the folders it lies in; ConfigError where it cannot be written."""
    try:
        make_folder_of(path)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{option} {path} cannot be written ({error.strerror}); choose another place") from None


def lock_folder(folder: Path) -> BaseFileLock:
    """Make a folder, this process's own as long as what is returned lives; several users in one process share it.

    Raises:
        ConfigError: another process writes there, or no file can be made there.
    """
    make_folder(folder)
    with writing(f"to {folder}", "choose another --out"):
        lock = FileLock(folder.resolve() / ".lock", timeout=0, is_singleton=True)
        try:
            lock.acquire()
        except Timeout:
            words = f"{folder} is being written to by another process; wait until it is done or choose another --out"
            raise ConfigError(words) from None
    return lock


def read_json(path: Path, what: str, remedy: str) -> Any:
    """Content of a JSON file, which may be cut, of another kind, or made to fill the memory.

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
    except RecursionError:
        words = "it is nested too deep"
    except OSError as error:
        words = error.strerror or type(error).__name__
    except (ValueError, MemoryError) as error:
        words = " ".join(str(error).split()) or type(error).__name__
    raise ConfigError(f"cannot read {what} from {path} ({words}); {remedy}")


def write_json(path: Path | None, content: Mapping[str, Any]) -> None:
    """Write JSON that every reader takes, where a path is given: not-a-number becomes null; it appears whole or not.

    Keys that were renamed stand under their earlier names, too, in ``deprecated``, for one release.

    Raises:
        ConfigError: the file cannot be written.
    """
    if path is None:
        return
    earlier = earlier_keys(content)
    content = {**content, "deprecated": earlier} if earlier else content
    text = json.dumps(finite(content), indent=2, default=plain_value, allow_nan=False)
    part = path.with_name(f".{path.name}.part")
    with writing(f"{path}"):
        make_folder_of(path)
        part.write_text(text + "\n", encoding="utf-8")
        os.replace(part, path)


def table_name(stem: str = "rows") -> str:
    """Name of the file that `write_table` writes."""
    return f"{stem}.csv" if find_spec("pyarrow") is None else f"{stem}.parquet"


def write_table(folder: Path, rows: Sequence[Mapping[str, Any]], stem: str = "rows") -> Path:
    """Write flat rows as Parquet when pyarrow is installed, else as CSV; ConfigError where they cannot be written."""
    import pandas as pd  # takes half a second, which commands without tables do not need

    path = folder / table_name(stem)
    table = pd.DataFrame(list(rows)).convert_dtypes()
    with writing(f"{path}"):
        (table.to_csv if path.suffix == ".csv" else table.to_parquet)(path, index=False)
    return path


def told_settings(value: Any) -> Any:
    """Nested settings with infinity as the text inf, as commands take it: JSON has no such number."""
    if isinstance(value, Mapping):
        return {key: told_settings(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [told_settings(item) for item in value]
    return f"{value:g}" if isinstance(value, float) and math.isinf(value) else value


def finite(value: Any) -> Any:
    """Replace every NaN and infinity in nested data by None."""
    value = plain_value(value) if hasattr(value, "tolist") else value
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def plain_value(value: Any) -> Any:
    """What JSON holds in place of an array, a number of numpy, or a path."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"cannot write a {type(value).__name__} as JSON")
