"""Files named on a command line: none is both read and written, and results are not written over something else."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from steerclear.shield.exceptions import ConfigError
from typer.models import OptionInfo

OTHERS = {
    ".mcap": "black boxes",
    ".tlog": "MAVLink logs",
    ".npz": "records and tables",
    ".html": "replays and reports",
    ".yaml": "fleet files",
    ".yml": "fleet files",
    ".py": "programs",
}
"""Endings of files that are no JSON."""


def check_files(function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Find out before hours of work that the files a command was given can be what they are to be.

    Args:
        function: the command.
        given: its arguments by name.

    Raises:
        ConfigError: one file is named for two things, or that of ``--json`` cannot be written.
    """
    check_apart({_spelling(function, name): value for name, value in given.items()})
    check_json_file(given.get("json_file"))


def check_apart(given: Mapping[str, Any]) -> None:
    """Refuse a file that is named by two arguments: writing one would destroy the other.

    Raises:
        ConfigError: there is one.
    """
    seen: dict[Path, str] = {}
    for name, value in given.items():
        for path in _files(value):
            other = seen.setdefault(path.resolve(), name)
            if other != name:
                raise ConfigError(f"{path} is named twice, by {other} and by {name}; name another file by one of them")


def check_json_file(path: Path | None) -> None:
    """Find out that the file of ``--json`` cannot be written.

    Raises:
        ConfigError: it is a folder, its name is none or another kind's, or the nearest folder that exists takes no
            files.
    """
    if path is None:
        return
    check_ending_is_not(path, "--json", OTHERS, ".json")
    try:
        if path.is_dir():
            raise ConfigError(f"--json {path} is a folder; name a file in it, such as {path / 'results.json'}")
        TemporaryFile(dir=next(folder for folder in path.absolute().parents if folder.exists())).close()
    except OSError as error:
        raise ConfigError(f"--json {path} cannot be written ({error.strerror}); name a file elsewhere") from error


def check_ending_is_not(path: Path, option: str, others: Mapping[str, str], own: str) -> None:
    """Refuse a name that ends as files of another kind do.

    Raises:
        ConfigError: it does.
    """
    kind = others.get(path.suffix.lower())
    if kind is not None:
        raise ConfigError(f"{option} {path} has the ending of {kind}; give a name that ends in {own}")


def check_ending(path: Path | None, option: str, endings: tuple[str, ...]) -> None:
    """Refuse a name with another ending than the kind of file written there has.

    Raises:
        ConfigError: it has.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise ConfigError(f"{option} {path} does not end in {' or '.join(endings)}; give a name that does")


def check_new(path: Path | None, option: str) -> None:
    """Refuse a name that a file has already: what a person made, learned or handed in is not written over.

    Raises:
        ConfigError: it is there.
    """
    if path is not None and (path.exists() or path.is_symlink()):
        raise ConfigError(f"{path} is there already; name another {option}, or remove it")


def _files(value: Any) -> Iterator[Path]:
    """Paths in an argument that are files, or will be."""
    for path in value if isinstance(value, list | tuple) else (value,):
        if isinstance(path, Path) and _is_file(path):
            yield path


def _is_file(path: Path) -> bool:
    """Whether there is such a file or could be: folders and devices may be named twice."""
    try:
        return path.is_file() or not path.exists()
    except OSError:  # a name that none has
        return False


def _spelling(function: Callable[..., Any], name: str) -> str:
    """An argument as users write it: its option, or its name."""
    hints = typing.get_type_hints(inspect.unwrap(function), include_extras=True)
    for info in typing.get_args(hints.get(name))[1:]:
        if isinstance(info, OptionInfo):
            long = [text for text in info.param_decls or () if text.startswith("--")]
            return long[0] if long else f"--{name.replace('_', '-')}"
    return name
