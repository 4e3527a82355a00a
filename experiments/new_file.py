"""Names of files that a command writes: what is there already is never written over."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from steerclear.shield.exceptions import ConfigError


@dataclass(frozen=True)
class NewFile:
    """In an option's ``Annotated``: the command writes that file, and is refused a name that is taken."""


NEW = NewFile()


def check_new(path: Path | None, option: str) -> None:
    """Refuse a name that something has already: what a person made, learned or measured is not written over.

    Args:
        path: the file; None: none is written.
        option: that names it, for the message.

    Raises:
        ConfigError: it is there.
    """
    if path is None:
        return
    if path.is_dir():
        raise ConfigError(f"{option} {path} is a folder; name a file in it")
    if path.exists() or path.is_symlink():
        raise ConfigError(f"{path} is there already; name another {option}, or remove it")
