"""Files that a command writes: what is there already is never written over, and folders are made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile

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


def check_place(path: Path | None, option: str) -> None:
    """Find out, before hours of work, that a file cannot be written: the nearest folder that is there takes none.

    Folders in between are made when the file is, see `make_folder_of`.

    Raises:
        ConfigError: it cannot be.
    """
    if path is None:
        return
    try:
        TemporaryFile(dir=next(folder for folder in path.absolute().parents if folder.exists())).close()
    except OSError as error:
        raise ConfigError(f"{option} {path} cannot be written ({error.strerror}); name a file elsewhere") from error


def make_folder_of(path: Path) -> None:
    """Make the folders that a file to be written lies in.

    Raises:
        OSError: one cannot be made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
