"""What a command line names: files, none both read and written, none written over; options, as errors tell them."""

from __future__ import annotations

import re
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from inspect import Parameter
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import ConfigError
from typer.models import OptionInfo

from .result_files import NEW, check_new, check_place
from .runner import BESIDE, EXPERIMENT_FILE, RESULTS_FILE, ROWS_FILE

OTHERS = {
    "black boxes": (".mcap",),
    "MAVLink logs": (".tlog",),
    "records and tables": (".npz",),
    "replays and reports": (".html",),
    "fleet files": (".yaml", ".yml"),
    "programs": (".py",),
    "entries and models": (".zip",),
    "pictures": (".png", ".svg", ".pdf"),
    "films": (".mp4", ".gif"),
    "tables": (".csv", ".parquet"),
    "games that are kept": (".jsonl",),
}
"""Endings of files that are no JSON."""
OURS = (EXPERIMENT_FILE, ROWS_FILE, RESULTS_FILE, *BESIDE)


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
    hints = hints_of(function)
    spelled = {name: spelling(name, hint) for name, hint in hints.items()}
    check_apart({spelled.get(name, name): value for name, value in given.items()})
    check_json_file(given.get("json_file"))
    folders = [
        given[name].resolve()
        for name, hint in hints.items()
        if isinstance(given.get(name), Path)
        and any(getattr(info, "metavar", "") == "DIR" for info in typing.get_args(hint)[1:])
    ]
    for name in written_by(function):
        option, value = spelled[name], given.get(name)
        check_each_once(value, option)
        for path in _files(value):
            if path.name in OURS and path.resolve().parent in folders:
                words = f"is what the command writes into {path.parent} itself; leave it out, or name another"
                raise ConfigError(f"{option} {path} {words}")
        for place in () if given.get("resume") else value if isinstance(value, list) else (value,):
            check_new(place, option)
            check_place(place, option)


def written_by(function: Callable[..., Any]) -> list[str]:
    """Names of the arguments of a command that are marked as files it writes."""
    return [name for name, hint in hints_of(function).items() if NEW in typing.get_args(hint)[1:]]


def check_apart(given: Mapping[str, Any]) -> None:
    """Refuse (ConfigError) a file that is named by two arguments: writing one would destroy the other."""
    seen: dict[Path, str] = {}
    for name, value in given.items():
        for path in _files(value):
            other = seen.setdefault(path.resolve(), name)
            if other != name:
                raise ConfigError(f"{path} is named twice, by {other} and by {name}; name another file by one of them")


def check_each_once(paths: Any, option: str) -> None:
    """Refuse (ConfigError) a file that one option names twice: it would be written twice, or read as if it were two."""
    seen: set[Path] = set()
    for path in _files(paths):
        if path.resolve() in seen:
            raise ConfigError(f"{path} is named twice by {option}; name every file once")
        seen.add(path.resolve())


def check_json_file(path: Path | None) -> None:
    """Refuse (ConfigError) a file of ``--json`` that has another kind's ending, is a folder, or cannot be written."""
    if path is None:
        return
    for kind, endings in OTHERS.items():
        if path.suffix.lower() in endings:
            raise ConfigError(f"--json {path} has the ending of {kind}; give a name that ends in .json")
    try:
        if path.is_dir():
            raise ConfigError(f"--json {path} is a folder; name a file in it, such as {path / 'results.json'}")
    except OSError as error:  # a name that none has
        raise ConfigError(f"--json {path} cannot be written ({error.strerror}); name a file elsewhere") from error
    check_place(path, "--json")


def check_ending(path: Path | None, option: str, *endings: str) -> None:
    """Refuse (ConfigError) a name with another ending than the kind of file written there has."""
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


def as_typed(text: str, options: Iterable[Parameter], given: Mapping[str, Any]) -> str:
    """Return an error's text with options as they were typed in place of the settings that it begins with.

    ``delay_s is -1.0; give ...`` becomes ``--delay is -1.0; give ...``, unless the setting itself was typed, by an
    option that takes KEY=VALUE.

    Args:
        text: of the error.
        options: of the command, with their defaults.
        given: the values of options by name.
    """
    begin = re.match(r"[a-z][\w-]*(, [\w-]+)*(?= (is|would|has|must) )", text)
    pairs = [pair for value in given.values() if isinstance(value, list) for pair in value if isinstance(pair, str)]
    keys = {pair.partition("=")[0].strip() for pair in pairs}
    typed = {one.name: spelling(one.name, one.annotation) for one in options if given[one.name] != one.default}

    def named(word: str) -> str:
        option = re.sub(r"_(m|s|mps)$", "", word).replace("-", "_")
        return word if word in keys else typed.get(option, word)

    return text if begin is None else ", ".join(map(named, begin[0].split(", "))) + text[begin.end() :]


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Hints of a function as written: Python 3.10 puts an Optional round what is annotated and None by default."""
    hints = typing.get_type_hints(function, include_extras=True)
    for name, hint in hints.items():
        parts = [part for part in typing.get_args(hint) if part is not type(None)]
        if typing.get_origin(hint) is typing.Union and len(parts) == 1 and hasattr(parts[0], "__metadata__"):
            hints[name] = parts[0]
    return hints


def spelling(name: str, hint: Any) -> str:
    """An argument as users write it: its option, or its name."""
    for info in typing.get_args(hint)[1:]:
        if isinstance(info, OptionInfo):
            first = (info.default,) if isinstance(info.default, str) else ()  # where Typer keeps it in an `Annotated`
            long = [text for text in (*first, *(info.param_decls or ())) if text.startswith("--")]
            return long[0] if long else f"--{name.replace('_', '-')}"
    return name
