"""A tournament's report: one HTML file, and the same as Markdown for the documentation."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from ..report.markdown import MADE, bars_table, line, table
from ..report.page import as_text, report_page, template, write_page
from ..report.parts import bars_table as bars_html
from ..report.parts import replay_links, values_table
from .figure import can_be_drawn, draw
from .tables import Table, all_tables, cycle_lines, shown

Results = Mapping[str, Any]
IMAGES = "; img-src data:"
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
    parts = {
        "TITLE": "The competition, with the shield and without",
        "STYLE": template("report.css"),
        "SUBTITLE": as_text(subtitle(results)),
        "WARNINGS": "".join(f'<p class="card bad">{as_text(words)}</p>' for words in results["warnings"]),
        "HEADLINES": "",
        "BARS": bars_html(results["bars"]),
        "REPLAYS": replay_links(replays),
        "FIGURE": _figure_html(results),
        "NOTE": as_text(NOTE),
        "CYCLES": "".join(f'<p class="note">{as_text(words)}</p>' for words in cycle_lines(results)),
        "TABLES": "".join(_table_html(one) for one in all_tables(results)),
        "SETTINGS": values_table(results["settings"]),
        "VERSIONS": values_table({**results["versions"], **results["machine"]}),
    }
    return write_page(path, report_page("tournament.html", parts, IMAGES))


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
    if results["bars"]:
        lines += ["## Bars", "", *bars_table(results["bars"]), ""]
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


def _figure_html(results: Results) -> str:
    if not can_be_drawn(results):
        return ""
    buffer = BytesIO()
    draw(results, buffer)
    data = base64.b64encode(buffer.getvalue()).decode()
    words = "net captures against collisions, an arrow per team from unshielded to shielded"
    return (
        f'<figure class="card"><img alt="{words}" style="max-width:100%" src="data:image/png;base64,{data}"></figure>'
    )


def _table_html(one: Table) -> str:
    title, heads, rows = one
    head = "".join(f"<th>{as_text(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{as_text(text)}</td>" for text in row) + "</tr>" for row in rows)
    table = f'<div class="scroll"><table><tr>{head}</tr>{body}</table></div>'  # many teams are wider than a card
    return f'<section class="card"><h3>{as_text(title)}</h3>{table}</section>'
