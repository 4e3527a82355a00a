"""``steerclear platform``: show, check and begin platform files."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform, known_platforms
from steerclear.shield.platforms.files import PlatformFile, is_path, load_platform, to_text
from steerclear.shield.platforms.schema import ENTRIES, GAINS, KIND_WORDS, MEASURED

from ..fit.words import about_the_boat, promise
from ..result_files import NEW, check_new, make_folder_of
from .console import command, out
from .files import check_ending
from .once import App

app = App(no_args_is_help=True, help="Platforms: boats behind their autopilots, as files.")
Named = Annotated[str, typer.Argument(metavar="NAME|FILE", help="A platform's name, or the path of its file.")]
Begin = Annotated[str, typer.Option("--from", metavar="NAME", help="The platform to begin with.")]
PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}")
Out = Annotated[Path | None, typer.Option("--out", metavar="FILE", help="A new file.", show_default="NAME.yaml"), NEW]


def file_of(name: str) -> PlatformFile:
    """The file of a platform named by its path or its name.

    Raises:
        PlatformError: there is none.
    """
    return load_platform(name) if is_path(name) else PlatformFile(get_platform(name))


@app.command("show")
@command
def show(name: Annotated[str | None, typer.Argument(metavar="[NAME|FILE]", show_default="all entries")] = None) -> None:
    """Print a platform as a file; without a name, every entry with its unit and the boats there are."""
    if name is not None:
        out().print(to_text(file_of(name)), markup=False, highlight=False, soft_wrap=True, end="")
        return
    table = Table(title="entries of a platform file: name, kind, and", title_justify="left", box=SIMPLE_HEAD)
    for column in ("entry, unit", "of kinds"):
        table.add_column(column, no_wrap=True)
    table.add_column("what it is")
    for key, entry in ENTRIES.items():
        named = f"{key}\n  {entry.unit}" if entry.unit else key
        table.add_row(named, "\n".join(entry.kinds), entry.words)
    for key, words in GAINS.items():
        table.add_row(f"*_pid.{key}", "usv\nrate", words)
    for key, entry in MEASURED.items():
        table.add_row(f"measured.{key}\n  {entry.unit}", "all", entry.words)
    out().print(table)
    for kind, words in KIND_WORDS.items():
        out().print(f"{kind}: {words}", soft_wrap=True)
    out().print(f"boats: {', '.join(sorted(known_platforms()))}", soft_wrap=True)


@app.command("check")
@command
def check(name: Named) -> None:
    """Read a platform, run it in its own model, and say what it does and what the shield then promises.

    Exit status: 0 it is a boat that can be steered, 2 it is not, with the reason.
    """
    file = file_of(name)
    for line in (*about_the_boat(file.platform), *promise(file)):
        out().print(line, soft_wrap=True)


@app.command("new")
@command
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the boat.")],
    begin: Begin = "ardurover_boat",
    file: Out = None,
) -> None:
    """Write a platform file to edit, with a word on each entry, beginning with a boat there is."""
    from dataclasses import replace

    if not PLAIN_NAME.fullmatch(name) or is_path(name):
        raise ConfigError(
            f"NAME is {name!r}; give 1 to 32 letters, digits, '_', '-' or '.', no file; say where with --out"
        )
    path = file or Path(f"{name}.yaml")
    check_ending(path, "--out", (".yaml", ".yml"))
    check_new(path, "--out")
    text = to_text(PlatformFile(replace(file_of(begin).platform, name=name)), "Edit, then: steerclear platform check")
    try:
        make_folder_of(path)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path} cannot be written ({error.strerror}); choose another place with --out") from None
    words = shlex.join(["steerclear", "platform", "check", str(path)])
    out().print(f"{path}\nnext: {words}", markup=False, soft_wrap=True)
