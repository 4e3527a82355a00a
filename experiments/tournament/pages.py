"""A tournament's report: one HTML file, and the same as Markdown for the documentation."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..markdown import MADE, goals_of, goals_table, line, table
from ..report import Plot, Report, Section, made_of
from ..report import Table as HtmlTable
from .figure import can_be_drawn, draw
from .tables import all_tables, cycle_lines, shown

Results = Mapping[str, Any]
NOTE = (
    "All figures are per double round robin (every pair once on each side); brackets are 95 % intervals of a bootstrap "
    "that draws repetitions anew within each pair and side. The paper's scores fit no single penalty, so its ranks are "
    "compared, not its scores."
)


def write_html(results: Results, path: Path, replays: Sequence[Mapping[str, str]] = ()) -> Path:
    """Write the report.

    Args:
        results: the content of results.json.
        path: file to write.
        replays: ``label`` and ``path`` of each replay.

    Raises:
        ConfigError: the file cannot be written.
    """
    return Report(
        title="The competition, with the shield and without",
        subtitle=subtitle(results),
        warnings=results["warnings"],
        links=replays,
        goals=results["goals"],
        plots=_figure(results),
        notes=[NOTE, *cycle_lines(results)],
        sections=[
            Section("", [HtmlTable(title, heads, rows, numbers=False) for title, heads, rows in all_tables(results)]),
            made_of(results),
        ],
    ).write(path)


def write_markdown(results: Results, folder: Path) -> tuple[str, str, list[Path]]:
    """The documentation page: its name, its text, and the figure written beside it."""
    stem = f"tournament_{results['settings']['preset']}"
    pictures = []
    lines = ["# The competition, with the shield and without", "", MADE, "", line(subtitle(results)) + ".", ""]
    if can_be_drawn(results):
        pictures = [folder / f"{stem}.png"]
        draw(results, pictures[0])
        lines += [f"![net captures against collisions]({stem}.png)", ""]
    notes = [*cycle_lines(results), *results["warnings"]]
    lines += [line(NOTE), "", *(f"- {line(words)}" for words in notes), *[""] * bool(notes)]
    for title, heads, rows in all_tables(results):
        lines += [f"## {line(title)}", "", *table(heads, rows), ""]
    if goals := goals_of(results):
        lines += ["## Goals", "", *goals_table(goals), ""]
    return f"{stem}.md", "\n".join(lines), pictures


def subtitle(results: Results) -> str:
    """What was played, in a line."""
    settings = results["settings"]
    length = (settings["rules"] or {}).get("max_time_s")
    repetitions = settings["repetitions"]
    return (
        f"{settings['preset']}, {results['games_played']} games"
        + (f" of {length:g} s" if length else "")
        + f", {repetitions} repetition{'' if repetitions == 1 else 's'} of every pair on both sides in every state, "
        + f"seeds {settings['seed']} to {settings['seed'] + repetitions - 1}, penalty {settings['penalty']:g}, "
        + f"steerclear {results['versions']['steerclear']}"
        + ("" if results["complete"] else f"; not complete: {_there(results)}")
    )


def _there(results: Results) -> str:
    """What there is of each state of a tournament that is not complete, and what its tables count."""
    return "; ".join(
        f"{shown(state['state'])} {state['games']} games, repetitions of every pair that met: {state['repetitions']}"
        for state in results["states"]
    )


def _figure(results: Results) -> list[Plot]:
    if not can_be_drawn(results):
        return []
    buffer = BytesIO()
    draw(results, buffer)
    data = base64.b64encode(buffer.getvalue()).decode()
    words = "net captures against collisions, an arrow per team from unshielded to shielded"
    image = f'<img alt="{words}" style="max-width:100%" src="data:image/png;base64,{data}">'
    return [Plot("What the shield changes for each team", Markup(image))]
