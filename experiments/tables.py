"""Tables as data, for terminal, HTML and Markdown alike, and how numbers are written in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.table import Table as RichTable
from rich.text import Text

from .metrics import game_metrics_of
from .verdicts import SHORT_HEADS, verdict_rows
from .words import count_text

Figure = Mapping[str, float | None]
COLUMNS = {
    "off": "shield off",
    "on": "shield on",
    "difference": "on - off, paired",
    "covered": "on, covered",
    "difference_covered": "covered - off, paired",
}
"""What is shown of a pairing's figures, where there is any, and its head."""
LEFT_HEAD, COVERED_HEAD = "on, left to the game", "on, covered"
IN_ZIP, ITS_OWN = OWN_SHIELDS = "shield in the zip", "its own shield"
"""Heads of games without a shield round them whose boats have one all the same, in their entry."""
BARE, AROUND = "entry alone", "shield round the game"
"""Heads of an entry's games beside `IN_ZIP`: no shield, and one that decides ten times a second."""
STATE_WORDS = (
    "Left to the game: boats that the game drives (tagged, out of bounds) are not shielded, as in a real game and a "
    "wrapped zip; covered: they are."
)
COVERED_WORDS = f"{STATE_WORDS} Goals are judged on shield on, left to the game."
_COVERED_SHOWN = ("captures", "net_captures", "clean_games", "changed_share")
"""Figures of the small table of covered games, beside hits; report and results have all."""
LEAST = 24
"""Characters in which words of a first column still go on in a second line."""


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
    games = count_text(max(summary["games_off"], summary["games_on"]), "game")
    title = f"{summary['pairing']}: {games}, means per game [95 % interval]"
    shown = {key: head for key, head in columns_of(summary).items() if "covered" not in key}
    return figures_table(title, summary["metrics"].values(), shown)


def covered_table(summary: Mapping[str, Any]) -> Group | None:
    """Of the games whose shield also covered boats that the game drives; None where there are none."""
    if not summary.get("games_covered"):
        return None
    shown = {key: head for key, head in columns_of(summary).items() if "covered" in key}
    chosen = [v for k, v in summary["metrics"].items() if k.startswith("violations_") or k in _COVERED_SHOWN]
    return figures_table("Covering boats that the game drives", chosen, shown)


def figures_table(title: str, metrics: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> Group:
    """A line per metric: its label and its figures, by key of ``columns``."""
    return titled(title, ["", *columns.values()], figure_rows(metrics, columns, short_limit))


def figure_rows(
    metrics: Iterable[Mapping[str, Any]], columns: Iterable[str], limit_text: Callable[[float], str] | None = None
) -> list[list[str]]:
    """Rows of labels and figures; what no column has a figure of is left out."""
    rows = [[one["label"], *(interval_text(one.get(key), limit_text) for key in columns)] for one in metrics]
    return [row for row in rows if any(text != "-" for text in row[1:])]


def verdict_table(summary: Mapping[str, Any]) -> Group | None:
    """What the post-hoc analysis says about a pairing's hits; None where it was not asked."""
    rows = verdict_rows(summary.get("verdicts") or {}, interval_text)
    seldom = [SHORT_HEADS.index(head) for head in ("inside", "unjudged")]
    shown = [k for k in range(len(SHORT_HEADS)) if k not in seldom or any(row[k] not in ("0", "-") for row in rows)]
    lines = [[row[k] for k in shown] for row in rows]
    return titled("Hits judged in hindsight", [SHORT_HEADS[k] for k in shown], lines) if rows else None


def titled(
    title: str, heads: Sequence[str], rows: Sequence[Sequence[str | Text]], width: int | None = None, wrap: bool = False
) -> Group:
    """Lay out a table for the terminal under its title; nothing of it is cut off, however narrow that is.

    Args:
        title: in bold above.
        heads: of the columns, the first words, the others numbers.
        rows: cells.
        width: of a column of numbers, at least, characters.
        wrap: whether long words of the first column go on in a second line.
    """
    return Group(Text(title, style="bold"), _Fitted(heads, rows, width, wrap))


@dataclass(frozen=True)
class _Fitted:
    """A table that fits the terminal: else limits and heads stand in a second line, else columns in a further table."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str | Text]]
    width: int | None
    wrap: bool

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        columns, most = list(range(len(self.heads))), options.max_width
        if self._room(columns, False) <= most:
            yield self._of(columns, False)
            return
        while columns:
            shown = columns[:]
            while len(shown) > 2 and self._room(shown, True) > most:
                shown.pop()
            yield self._of(shown, True)
            columns = columns[:1] + columns[len(shown) :] if len(shown) < len(columns) else []

    def _room(self, columns: Sequence[int], broken: bool) -> int:
        """Characters that these columns need, side by side."""
        tables = (self.heads, *self.rows)
        cells = [[str(self._cell(row, k, broken)) for row in tables] for k in columns]
        room = [max(cell_len(line) for cell in column for line in cell.split("\n")) for column in cells]
        room = [max(wide, self.width or 0) if k else wide for k, wide in enumerate(room)]
        return sum(room[1:]) + (min(room[0], LEAST) if self.wrap else room[0]) + len(room) - 1

    def _cell(self, row: Sequence[str | Text], k: int, broken: bool) -> str | Text:
        """A cell; broken: limits, or the words of a head, stand in a second line."""
        cell, at = row[k], " " if row is self.heads else " ["
        return cell.replace(at, f"\n{at.strip()}", 1) if broken and isinstance(cell, str) else cell

    def _of(self, columns: Sequence[int], broken: bool) -> RichTable:
        # the dividers alone part the columns: four columns of intervals fit 80 characters
        table = RichTable(box=box.SIMPLE_HEAD, show_edge=False, padding=0, pad_edge=False, show_header=any(self.heads))
        for k in columns:
            head = self._cell(self.heads, k, broken)
            if k == columns[0]:
                table.add_column(head, no_wrap=len(self.heads) > 1 and not self.wrap)
            else:
                table.add_column(head, justify="right", no_wrap=True, min_width=self.width)
        for row in self.rows:
            table.add_row(*(self._cell(row, k, broken and k > 0) for k in columns))
        return table


def goals_table(goals: Sequence[Mapping[str, Any]]) -> Group:
    """What is asked, what was measured, whether it is met."""
    rows: list[list[str | Text]] = []
    for goal in goals:
        name, measured, asked = goal_cells(goal)
        rows.append([name, measured + limits_text(goal, short_limit), asked, Text(*verdict_of(goal))])
    return titled("Goals", ["", "measured", "goal", ""], rows, wrap=True)


def verdict_of(goal: Mapping[str, Any]) -> tuple[str, str]:
    """Whether a goal is met, in words and by a colour; an interval on both sides of the limit settles nothing."""
    words, colour = {True: ("met", "green"), False: ("not met", "red"), None: ("no data", "yellow")}[goal["met"]]
    low, high = goal.get("low"), goal.get("high")
    if goal["met"] is not None and low is not None and high is not None and low < goal["limit"] < high:
        return f"{words} (too few to tell)", "yellow"
    return words, colour


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
    """Write `` [low, high]``, nothing where there is no value or there are no limits."""
    limits = [figure["low"], figure["high"]]
    if any(number is None or number != number for number in (figure["value"], *limits)):
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
    """A single game: its row, and the radii at which hits were counted, m."""
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
