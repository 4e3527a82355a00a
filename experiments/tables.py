"""Tables for the terminal: one per pairing, readable at 80 columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

Figure = Mapping[str, float | None]


def pairing_table(summary: Mapping[str, Any]) -> Table:
    """Build the table of a pairing: each figure without and with the shield, and the paired difference.

    Args:
        summary: as `summary.summarise` returns it.
    """
    games = max(summary["games_off"], summary["games_on"])
    title = f"{summary['pairing']}: {games} game{'s' if games != 1 else ''}, means per game [95 % interval]"
    both = bool(summary["games_off"] and summary["games_on"])
    columns = [
        ("off", "shield off", bool(summary["games_off"])),
        ("on", "shield on", bool(summary["games_on"])),
        ("difference", "on - off, paired", both),
    ]
    shown = [(key, head) for key, head, present in columns if present]
    table = new_table(title, ["", *(head for _, head in shown)])
    for figures in summary["metrics"].values():
        table.add_row(figures["label"], *(interval_text(figures.get(key)) for key, _ in shown))
    return table


def new_table(title: str, heads: Sequence[str]) -> Table:
    """Start a table whose first column is words and whose others are numbers."""
    table = _bare_table(title)
    table.add_column(heads[0], no_wrap=True)
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def _bare_table(title: str) -> Table:
    # one space beside each divider and none at the edges: four columns of intervals fit 80 characters
    look = {"box": box.SIMPLE_HEAD, "show_edge": False, "padding": (0, 0, 0, 1), "pad_edge": False}
    return Table(title=title, title_justify="left", title_style="bold", **look)


def bars_table(bars: Sequence[Mapping[str, Any]]) -> Table:
    """Build the table of bars: what is asked, what was measured, whether it is met."""
    table = _bare_table("Bars")
    table.add_column("")
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("bar", justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for bar in bars:
        verdict = Text("met", "green") if bar["met"] else Text("not met", "red")
        table.add_row(bar["name"], number_text(bar["value"]), f"{bar['sense']} {number_text(bar['limit'])}", verdict)
    return table


def interval_text(figure: Figure | None) -> str:
    """Write ``value [low, high]``; a dash where there is no figure, no brackets where there are no limits."""
    if figure is None or figure["value"] is None or figure["value"] != figure["value"]:
        return "-"
    limits = [figure["low"], figure["high"]]
    text = number_text(figure["value"])
    if any(limit is None or limit != limit for limit in limits):
        return text
    return f"{text} [{number_text(limits[0])}, {number_text(limits[1])}]"


def number_text(value: float | None) -> str:
    """Write a number with about three digits."""
    if value is None or value != value:
        return "-"
    if float(value).is_integer() and abs(value) >= 1000:
        return f"{value:,.0f}"
    size = abs(round(value, 2))
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"
