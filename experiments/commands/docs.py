"""``steerclear docs``: documentation pages from results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.tables.files import read_table

from ..docs import SOURCES, write_pages
from ..result_files import read_json
from ..runner import RESULTS_FILE
from .console import command, out

Sources = Annotated[
    list[Path] | None, typer.Argument(help=f"Results folders or JSON files of {SOURCES}; value tables (.npz).")
]
Folder = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pages.")]


@command
def docs(sources: Sources = None, folder: Folder = Path("docs")) -> None:
    """Write documentation pages, tables and plots, from results.

    Exit status: 0 done, 2 bad input.
    """
    for path in write_pages([_read(source) for source in sources or []], folder):
        out().print(f"{path}", soft_wrap=True)


def _read(source: Path) -> dict[str, Any]:
    if source.suffix == ".npz":
        return {"command": "reach", "card": read_table(source).card.to_json()}
    path = source / RESULTS_FILE if source.is_dir() else source
    content = read_json(path, "results", "give a results folder or a JSON file")
    if not isinstance(content, dict):
        raise ConfigError(f"{path} holds no results; give a results folder or a JSON file of {SOURCES}")
    return content
