"""Tables for the terminal: one per pairing, readable at 80 columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from .tally import breach_column

Figure = Mapping[str, float | None]
_KINDS = (("teammate", "team-mate"), ("opponent", "opponent"))
_VERDICTS = {True: Text("met", "green"), False: Text("not met", "red"), None: Text("no data", "yellow")}


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
        table.add_row(figures["label"], *(interval_text(figures.get(key), short_limit) for key, _ in shown))
    return table


def new_table(title: str, heads: Sequence[str]) -> Table:
    """Start a table whose first column is words and whose others are numbers."""
    table = _bare_table(title)
    table.add_column(heads[0], no_wrap=True)
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def _bare_table(title: str) -> Table:
    # the dividers alone part the columns: four columns of intervals fit 80 characters
    look = {"box": box.SIMPLE_HEAD, "show_edge": False, "padding": 0, "pad_edge": False}
    return Table(title=title, title_justify="left", title_style="bold", **look)


def bars_table(bars: Sequence[Mapping[str, Any]]) -> Table:
    """Build the table of bars: what is asked, what was measured, whether it is met."""
    table = _bare_table("Bars")
    table.add_column("")
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("bar", justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for bar in bars:
        verdict = _VERDICTS[bar["met"]]
        table.add_row(bar["name"], number_text(bar["value"]), f"{bar['sense']} {number_text(bar['limit'])}", verdict)
    return table


def interval_text(figure: Figure | None, limit_text: Callable[[float], str] | None = None) -> str:
    """Write ``value [low, high]``; a dash where there is no figure, no brackets where there are no limits.

    Args:
        figure: value, low and high.
        limit_text: how to write a limit; None writes it as the value.
    """
    if figure is None or figure["value"] is None or figure["value"] != figure["value"]:
        return "-"
    limits = [figure["low"], figure["high"]]
    text = number_text(figure["value"])
    if any(limit is None or limit != limit for limit in limits):
        return text
    low, high = ((limit_text or number_text)(float(limit)) for limit in limits if limit is not None)
    return f"{text} [{low}, {high}]"


def short_limit(value: float) -> str:
    """Write a limit of an interval with about two digits."""
    size = abs(round(value, 2))
    return f"{value:.0f}" if size >= 10 else f"{value:.1f}" if size >= 1 else f"{value:.2f}"


def number_text(value: float | None) -> str:
    """Write a number with about three digits."""
    if value is None or value != value:
        return "-"
    if float(value).is_integer() and abs(value) >= 1000:
        return f"{value:,.0f}"
    size = abs(round(value, 2))
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"


def game_table(row: Mapping[str, Any], radii_m: Sequence[float]) -> Table:
    """Build the table of a single game.

    Args:
        row: its columns, see `keys.GAME_COLUMNS`.
        radii_m: radii at which breaches were counted.
    """
    state = "shielded" if row["shielded"] else "not shielded"
    table = _bare_table(f"{row['pairing']}, {row['side']} {state}, {row['duration_s']:g} s")
    table.add_column("", no_wrap=True)
    table.add_column("", justify="right", no_wrap=True)
    for name, words in _game_lines(radii_m):
        if row.get(name) is not None:
            table.add_row(words, number_text(row[name]))
    if row["first_failure"]:
        table.add_row("first policy failure", Text(str(row["first_failure"]), overflow="fold"))
    return table


def _game_lines(radii_m: Sequence[float]) -> list[tuple[str, str]]:
    hits = [(breach_column(k, r), f"hits {words} {r:g} m") for k, words in _KINDS for r in radii_m]
    return [
        ("captures", "captures"),
        ("captures_against", "captures against"),
        ("grabs", "grabs"),
        ("tags", "tags"),
        ("tags_against", "times tagged"),
        *hits,
        ("closest_m", "closest, m"),
        ("changed_share", "share of steps changed"),
        ("mean_heading_change_deg", "mean change, deg"),
        ("mean_speed_change_mps", "mean change, m/s"),
        ("decision_p50_us", "decision p50, us"),
        ("decision_p99_us", "decision p99, us"),
        ("primary", "primary score"),
        ("secondary", "secondary score"),
        ("policy_failures", "policy failures"),
        ("opponent_policy_failures", "opponent's policy failures"),
    ]
