"""Files named on a command line: none is both read and written, and none that is there is written over."""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError
from typer.models import OptionInfo

from .result_files import NEW, check_new, check_place
from .runner import BESIDE, EXPERIMENT_FILE, RESULTS_FILE, ROWS_FILE

OTHERS = {
    ".mcap": "black boxes",
    ".tlog": "MAVLink logs",
    ".npz": "records and tables",
    ".html": "replays and reports",
    ".yaml": "fleet files",
    ".yml": "fleet files",
    ".py": "programs",
    ".zip": "entries and models",
    ".png": "pictures",
    ".svg": "pictures",
    ".pdf": "pictures",
    ".mp4": "films",
    ".gif": "films",
    ".csv": "tables",
    ".parquet": "tables",
    ".jsonl": "games that are kept",
}
"""Endings of files that are no JSON."""


def check_files(function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Find out before hours of work that the files a command was given can be what they are to be.

    A run that is gone on with (``resume``) writes again what it wrote before.

    Args:
        function: the command; options marked `NEW` are files that it writes.
        given: its arguments by name.

    Raises:
        ConfigError: one file is named for two things, or is what the command writes into its folder of results, that of
            ``--json`` cannot be written, or one to write is there.
    """
    spelled = {name: _spelling(name, hint) for name, hint in hints_of(function).items()}
    check_apart({spelled.get(name, name): value for name, value in given.items()})
    check_json_file(given.get("json_file"))
    folders = [given[name] for name in _folders(function) if isinstance(given.get(name), Path)]
    for name in written_by(function):
        check_each_once(given.get(name), spelled[name])
        _check_not_in(given.get(name), spelled[name], folders)
        value = None if given.get("resume") else given.get(name)
        for path in value if isinstance(value, list) else (value,):
            check_new(path, spelled[name])
            check_place(path, spelled[name])


def written_by(function: Callable[..., Any]) -> list[str]:
    """Names of the arguments of a command that are marked as files it writes."""
    return [name for name, hint in hints_of(function).items() if NEW in typing.get_args(hint)[1:]]


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


def check_each_once(paths: Any, option: str) -> None:
    """Refuse a file that one option names twice: it would be written twice, or read as if it were two.

    Raises:
        ConfigError: there is one.
    """
    seen: set[Path] = set()
    for path in _files(paths):
        if path.resolve() in seen:
            raise ConfigError(f"{path} is named twice by {option}; name every file once")
        seen.add(path.resolve())


def _check_not_in(paths: Any, option: str, folders: list[Path]) -> None:
    """Refuse a file that the command itself writes into its folder of results."""
    for path in _files(paths):
        ours = path.name in (EXPERIMENT_FILE, ROWS_FILE, RESULTS_FILE, *BESIDE)
        for folder in folders:
            if ours and path.resolve().parent == folder.resolve():
                raise ConfigError(
                    f"{option} {path} is what the command writes into {folder} itself; leave it out, or name another"
                )


def check_json_file(path: Path | None) -> None:
    """Find out that the file of ``--json`` cannot be written.

    Raises:
        ConfigError: it is a folder, its name is none or another kind's, or the nearest folder that exists takes no
            files.
    """
    if path is None:
        return
    if kind := OTHERS.get(path.suffix.lower()):
        raise ConfigError(f"--json {path} has the ending of {kind}; give a name that ends in .json")
    try:
        if path.is_dir():
            raise ConfigError(f"--json {path} is a folder; name a file in it, such as {path / 'results.json'}")
    except OSError as error:  # a name that none has
        raise ConfigError(f"--json {path} cannot be written ({error.strerror}); name a file elsewhere") from error
    check_place(path, "--json")


def check_ending(path: Path | None, option: str, *endings: str) -> None:
    """Refuse a name with another ending than the kind of file written there has.

    Raises:
        ConfigError: it has.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise ConfigError(f"{option} {path} does not end in {' or '.join(endings)}; give a name that does")


def _files(value: Any) -> Iterator[Path]:
    """Paths in an argument that are files, or will be: folders and devices may be named twice."""
    for path in value if isinstance(value, list | tuple) else (value,):
        try:
            if isinstance(path, Path) and (path.is_file() or not path.exists()):
                yield path
        except OSError:  # a name that none has
            continue


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Hints of a function as written: Python 3.10 puts an Optional round what is annotated and None by default."""
    hints = typing.get_type_hints(function, include_extras=True)
    for name, hint in hints.items():
        parts = [part for part in typing.get_args(hint) if part is not type(None)]
        if typing.get_origin(hint) is typing.Union and len(parts) == 1 and hasattr(parts[0], "__metadata__"):
            hints[name] = parts[0]
    return hints


def _folders(function: Callable[..., Any]) -> list[str]:
    """Names of the arguments that are folders of results."""
    infos = {name: typing.get_args(hint)[1:] for name, hint in hints_of(function).items()}
    return [name for name, found in infos.items() if any(getattr(info, "metavar", "") == "DIR" for info in found)]


def _spelling(name: str, hint: Any) -> str:
    """An argument as users write it: its option, or its name."""
    for info in typing.get_args(hint)[1:]:
        if isinstance(info, OptionInfo):
            first = (info.default,) if isinstance(info.default, str) else ()  # where Typer keeps it in an `Annotated`
            long = [text for text in (*first, *(info.param_decls or ())) if text.startswith("--")]
            return long[0] if long else f"--{name.replace('_', '-')}"
    return name
