"""The texts and tables of an ablation's report, as HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..measure.tally import breach_column
from .ablation_plots import number
from .meanings import FIGURES
from .page import as_text
from .tables import interval_text, limits_text, measured_text, number_text

Summary = Mapping[str, Any]
MOST_ROWS = 600
VERDICTS = {True: ("met", "good"), False: ("not met", "bad"), None: ("no data", "muted")}


def headlines(pairings: Sequence[Summary], separation_m: float) -> str:
    """Write the numbers that matter most, means over all games."""
    hits = f"centres within {separation_m:g} m, per game"
    tiles = [
        ("hits with opponents", breach_column("opponent", separation_m), hits),
        ("hits with team-mates", breach_column("teammate", separation_m), hits),
        ("captures", "captures", "per game"),
        ("closest distance", "closest_m", "m, mean of the games"),
        ("steps changed", "changed_share", "% of the commands decided"),
    ]
    return "".join(_tile(label, _overall(pairings, name), note) for label, name, note in tiles)


def _overall(pairings: Sequence[Summary], metric: str) -> dict[str, float | None]:
    """Return the mean of a figure over all games, without and with the shield."""
    means: dict[str, float | None] = {}
    for state in ("off", "on"):
        total, games = 0.0, 0
        for pairing in pairings:
            value = number((pairing["metrics"][metric].get(state) or {}).get("value"))
            if value is not None:
                total += value * pairing[f"games_{state}"]
                games += pairing[f"games_{state}"]
        means[state] = total / games if games else None
    return means


def _tile(label: str, means: Mapping[str, float | None], note: str) -> str:
    off, on = means["off"], means["on"]
    numbers = f'<span class="on">{number_text(on)}</span>'
    if off is not None:
        numbers = f'<span class="off">{number_text(off)}</span><span class="arrow">→</span>{numbers}'
    return f'<div class="tile"><h3>{label}</h3><p class="numbers">{numbers}</p><p class="note">{note}</p></div>'


def bars_table(bars: Sequence[Mapping[str, Any]]) -> str:
    """Write what was asked, what was measured, and whether it is met."""
    if not bars:
        return ""
    rows = []
    for bar in bars:
        text, style = VERDICTS[bar["met"]]
        limit = f"{bar['sense']} {number_text(bar['limit'])}".replace("<=", "≤").replace(">=", "≥")
        measured = as_text(measured_text(bar) + limits_text(bar))
        rows.append(
            f'<tr><td>{as_text(bar["name"])}</td><td class="number">{measured}</td>'
            f'<td class="number">{limit}</td><td><span class="verdict {style}">{text}</span></td></tr>'
        )
    head = "<tr><th>bar</th><th class='number'>measured</th><th class='number'>asked</th><th></th></tr>"
    return f'<section class="card"><h2>Bars</h2><table>{head}{"".join(rows)}</table></section>'


def legend(entries: Sequence[tuple[str, str]]) -> str:
    """Write what a plot's colours mean, from class and name."""
    keys = "".join(f'<span><i class="{style}"></i>{as_text(name)}</span>' for style, name in entries)
    return f'<p class="legend">{keys}</p>' if entries else ""


def meanings(entries: Sequence[tuple[str, str]]) -> str:
    """Write words with what they mean."""
    lines = "".join(f"<dt>{as_text(name)}</dt><dd>{as_text(meaning)}</dd>" for name, meaning in entries)
    return f'<dl class="note">{lines}</dl>' if entries else ""


def pairing_tables(pairings: Sequence[Summary]) -> str:
    """Write a table of all figures of each pairing."""
    return "".join(_pairing_table(pairing) for pairing in pairings)


def _pairing_table(pairing: Summary) -> str:
    heads = (("off", "shield off"), ("on", "shield on"), ("difference", "on − off, paired"))
    head = "<th></th>" + "".join(f'<th class="number">{text}</th>' for _, text in heads)
    rows = []
    for name, figures in pairing["metrics"].items():
        cells = "".join(f'<td class="number">{as_text(interval_text(figures.get(key)))}</td>' for key, _ in heads)
        meaning = f'<p class="note">{as_text(FIGURES[name])}</p>' if name in FIGURES else ""
        rows.append(f"<tr><td>{as_text(figures.get('label', name))}{meaning}</td>{cells}</tr>")
    played = f"{pairing['games_off']} games without, {pairing['games_on']} with the shield"
    title = f"<h3>{as_text(pairing['pairing'])}</h3><p class='note'>{played}; per game [95 % interval]</p>"
    return f'<section class="card wide">{title}<table><tr>{head}</tr>{"".join(rows)}</table></section>'


def replay_links(replays: Sequence[Mapping[str, str]]) -> str:
    """Write links to the replays beside the report."""
    links = "".join(f'<a class="button" href="{as_text(r["path"])}">▶ {as_text(r["label"])}</a>' for r in replays)
    return f'<p class="links">{links}</p>' if links else ""


def values_table(values: Mapping[str, Any]) -> str:
    """Write names and values."""
    rows = "".join(
        f"<tr><td>{as_text(name)}</td><td>{as_text(_plain(value))}</td></tr>" for name, value in values.items()
    )
    return f"<table>{rows}</table>"


def _plain(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {_plain(entry)}" for name, entry in value.items()) or "defaults"
    if isinstance(value, list | tuple):
        return ", ".join(map(_plain, value))
    return "–" if value is None else str(value)


def games_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Write the rows of games, the first ``MOST_ROWS`` of them."""
    columns = [name for name in dict.fromkeys(n for row in rows for n in row) if any(_given(row, name) for row in rows)]
    head = "".join(f"<th>{as_text(name.replace('_', ' '))}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{as_text(_cell(row.get(name)))}</td>" for name in columns) + "</tr>"
        for row in rows[:MOST_ROWS]
    )
    more = f"<p class='note'>{len(rows) - MOST_ROWS} more in the table of games.</p>" if len(rows) > MOST_ROWS else ""
    return f'<div class="scroll"><table>{"<tr>" + head + "</tr>"}{body}</table></div>{more}'


def _given(row: Mapping[str, Any], name: str) -> bool:
    return row.get(name) is not None


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number_text(value) if isinstance(value, float) else _plain(value)
