"""Tables as data, for terminal, HTML and Markdown alike, and how numbers are written in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.console import Group
from rich.table import Table as RichTable
from rich.text import Text

from .metrics import game_metrics_of
from .verdicts import SHORT_HEADS, verdict_rows

Figure = Mapping[str, float | None]
COLUMNS = {
    "off": "shield off",
    "on": "shield on",
    "difference": "on - off, paired",
    "covered": "covered",
    "difference_covered": "covered - off, paired",
}
"""What is shown of a pairing's figures, where there is any, and its head."""
COVERED_WORDS = (
    "Shield on leaves boats that the game drives (tagged, out of bounds) to it, as a real game and a wrapped zip do; "
    "covered decides for them too. Goals are of shield on."
)
_COVERED_SHOWN = ("captures", "net_captures", "clean_games", "changed_share")
"""Figures of the small table of covered games, beside hits; report and results have all."""
_VERDICTS = {True: Text("met", "green"), False: Text("not met", "red"), None: Text("no data", "yellow")}


@dataclass(frozen=True)
class Table:
    """A table: the first column words, the others numbers unless ``numbers`` is off; ``folded``: opened by a click."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[Any]]
    note: str = ""
    more: str = ""
    folded: bool = False
    numbers: bool = True


def columns_of(summary: Mapping[str, Any]) -> dict[str, str]:
    """The `COLUMNS` that some figure of a pairing (of `ablation.pairings_of`) has, under its own ``heads``."""
    heads = COLUMNS | (summary.get("heads") or {})
    return {k: head for k, head in heads.items() if any(k in figures for figures in summary["metrics"].values())}


def pairing_table(summary: Mapping[str, Any]) -> Group:
    """Each figure of a pairing without and with the shield, and the paired difference."""
    games = max(summary["games_off"], summary["games_on"])
    title = f"{summary['pairing']}: {games} game{'s' if games != 1 else ''}, means per game [95 % interval]"
    shown = {key: head for key, head in columns_of(summary).items() if "covered" not in key}
    return figures_table(title, summary["metrics"].values(), shown)


def covered_table(summary: Mapping[str, Any]) -> Group | None:
    """Of the games whose shield also covered boats that the game drives; None where there are none."""
    if not summary.get("games_covered"):
        return None
    shown = {key: head for key, head in COLUMNS.items() if "covered" in key}
    chosen = [v for k, v in summary["metrics"].items() if k.startswith("breaches_") or k in _COVERED_SHOWN]
    return figures_table("Covering boats that the game drives", chosen, shown)


def figures_table(title: str, metrics: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> Group:
    """A line per metric: its label and its figures, by key of ``columns``."""
    rows = [[one["label"], *(interval_text(one.get(key), short_limit) for key in columns)] for one in metrics]
    return titled(title, ["", *columns.values()], rows)


def verdict_table(summary: Mapping[str, Any]) -> Group | None:
    """What the post-hoc analysis says about a pairing's breaches; None where it was not asked."""
    rows = verdict_rows(summary.get("verdicts") or {}, interval_text)
    return titled("Hits judged in hindsight", SHORT_HEADS, rows) if rows else None


def titled(
    title: str, heads: Sequence[str], rows: Sequence[Sequence[str | Text]], width: int | None = None, wrap: bool = False
) -> Group:
    """Lay out a table for the terminal under its title.

    Args:
        title: in bold above.
        heads: of the columns, the first words, the others numbers.
        rows: cells.
        width: of a column of numbers, at least, characters.
        wrap: whether long words of the first column go on in a second line rather than lose their end.
    """
    # the dividers alone part the columns: four columns of intervals fit 80 characters
    table = RichTable(box=box.SIMPLE_HEAD, show_edge=False, padding=0, pad_edge=False, show_header=any(heads))
    table.add_column(heads[0], no_wrap=len(heads) > 1 and not wrap)
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True, min_width=width)
    for row in rows:
        table.add_row(*row)
    return Group(Text(title, style="bold"), table)


def goals_table(goals: Sequence[Mapping[str, Any]]) -> Group:
    """What is asked, what was measured, whether it is met."""
    rows: list[list[str | Text]] = [[*goal_cells(goal), _VERDICTS[goal["met"]]] for goal in goals]
    return titled("Goals", ["", "measured", "goal", ""], rows, wrap=True)


def goal_cells(goal: Mapping[str, Any]) -> list[str]:
    """A goal's name, with what is beside it, what was measured, and what is asked."""
    name = f"{goal['name']} ({goal['note']})" if goal.get("note") else goal["name"]
    return [name, measured_text(goal), f"{goal['sense']} {number_text(goal['limit'])}"]


def interval_text(figure: Figure | None, limit_text: Callable[[float], str] | None = None) -> str:
    """Write ``value [low, high]``: a dash where there is no figure, no brackets where there are no limits."""
    if figure is None or figure["value"] is None or figure["value"] != figure["value"]:
        return "-"
    return number_text(figure["value"]) + limits_text(figure, limit_text)


def limits_text(figure: Figure, limit_text: Callable[[float], str] | None = None) -> str:
    """Write `` [low, high]``, nothing where there are no limits."""
    limits = [figure["low"], figure["high"]]
    if any(limit is None or limit != limit for limit in limits):
        return ""
    return f" [{', '.join((limit_text or number_text)(float(limit)) for limit in limits if limit is not None)}]"


def short_limit(value: float) -> str:
    """Write a limit of an interval with about two digits."""
    size = abs(round(value, 2))
    return f"{value:.0f}" if size >= 10 else f"{value:.1f}" if size >= 1 else f"{value:.2f}"


def number_text(value: float | None) -> str:
    """Write a number with about three digits, a whole one (int) as it is."""
    if value is None or value != value:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    size = abs(round(value, 2))
    return f"{value:,.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"


def measured_text(goal: Mapping[str, Any]) -> str:
    """Write what was measured for a goal, with so many digits that it differs from the limit where it does."""
    value, limit = goal["value"], goal["limit"]
    text = number_text(value)
    if text == "-" or value == limit or text != number_text(limit):
        return text
    shown = (f"{value:.{digits}g}" for digits in range(2, 18))
    return next(text for text in shown if float(text) != limit)


def game_table(row: Mapping[str, Any], radii_m: Sequence[float]) -> Group:
    """A single game: its row, and the radii at which breaches were counted, m."""
    state = "shielded" if row["shielded"] else "not shielded"
    title = f"{row['pairing']}, {row['side']} {state}, {row['duration_s']:g} s"
    shown: dict[str, Any] = {}
    for metric in game_metrics_of(radii_m):
        if metric.kind == "percent":
            shown[metric.label] = 100.0 * row[metric.column] / row[metric.per] if row[metric.per] else None
        elif metric.kind in ("count", "mean"):
            shown[metric.label.replace(" mean m", " m")] = row.get(metric.column)
    shown |= {"policy failures": row["policy_failures"], "opponent's": row["opponent_policy_failures"]}
    return titled(title, ["", ""], [[words, number_text(value)] for words, value in shown.items() if value is not None])
