"""``steerclear compare``: two results beside one another, paired by seed."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..compare_runs import compare_runs, read_run
from ..provenance import machine, versions
from ..result_files import write_json
from ..tables import interval_text, short_limit, titled
from . import options as o
from .console import command, out
from .games import FEW_GAMES

First = Annotated[Path, typer.Argument(metavar="A", help="Results folder of ablate or evaluate.", show_default=False)]
Second = Annotated[Path, typer.Argument(metavar="B", help="The same with another setting.", show_default=False)]
CHANCE_WORDS = "Of figures that nothing changed one in twenty has an interval without 0: look at the few you asked for."


@command
def compare(first: First, second: Second, json_file: o.JsonFile = None) -> None:
    """Compare two settings: games of two results folders from the same seeds, B less A with 95 % intervals.

    Games with the shield are compared, where a folder has any. Exit status: 0 done, 2 bad input, or games that are no
    pairs.
    """
    started = time.perf_counter()
    found = compare_runs(read_run(first), read_run(second))
    _show(found)
    if json_file is not None:
        settings = {"first": str(first), "second": str(second)}
        head = {"command": "compare", "settings": settings, "versions": versions(), "machine": machine()}
        write_json(json_file, {**head, "wall_s": time.perf_counter() - started, **found})


def _show(found: dict[str, Any]) -> None:
    console = out()
    for letter, run in (("A", found["first"]), ("B", found["second"])):
        shield = "with its shield" if run["shielded"] else "without a shield"
        console.print(f"{letter}: {run['folder']}, {run['own']} {shield}", markup=False, soft_wrap=True)
    for name, (before, after) in found["differs"].items():
        words = f"differs: {name}: {_told(before)} -> {_told(after)}"
        console.print(words, markup=False, soft_wrap=True)
    if not found["differs"]:
        console.print("No setting differs: these are the same games.")
    for pairing in found["pairings"]:
        title = f"\nagainst {pairing['opponent']}: {pairing['pairs']} pairs, means per game [95 % interval]"
        rows = [
            [figures["label"], *(interval_text(figures[key], short_limit) for key in ("first", "second", "difference"))]
            for figures in pairing["metrics"].values()
        ]
        console.print(titled(title, ["", "A", "B", "B - A, paired"], rows))
    console.print(f"\n{CHANCE_WORDS}", soft_wrap=True)
    if min(pairing["pairs"] for pairing in found["pairings"]) < FEW_GAMES:
        console.print(f"Intervals of fewer than {FEW_GAMES} pairs say little.", soft_wrap=True)


def _told(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(str(one)[:12] or "none" for one in value) or "none"
    return "default" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
