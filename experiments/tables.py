"""Tables for the terminal: one per pairing, readable at 80 columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from .metrics import breach_column
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
_KINDS = (("teammate", "teammate"), ("opponent", "opponent"))
_COVERED_SHOWN = ("captures", "net_captures", "clean_games", "changed_share")
"""Figures of the small table of covered games, beside hits; report and results have all."""
_VERDICTS = {True: Text("met", "green"), False: Text("not met", "red"), None: Text("no data", "yellow")}


def columns_of(summary: Mapping[str, Any]) -> dict[str, str]:
    """The `COLUMNS` that some figure of a pairing has.

    Args:
        summary: as `ablation.pairings_of` returns it.
    """
    return {k: head for k, head in COLUMNS.items() if any(k in figures for figures in summary["metrics"].values())}


def pairing_table(summary: Mapping[str, Any]) -> Group:
    """Build the table of a pairing: each figure without and with the shield, and the paired difference.

    Args:
        summary: as `ablation.pairings_of` returns it.
    """
    games = max(summary["games_off"], summary["games_on"])
    title = f"{summary['pairing']}: {games} game{'s' if games != 1 else ''}, means per game [95 % interval]"
    shown = {key: head for key, head in columns_of(summary).items() if "covered" not in key}
    return _figures(title, summary["metrics"].values(), shown)


def covered_table(summary: Mapping[str, Any]) -> Group | None:
    """Build the table of the games whose shield also covered boats that the game drives; None where there are none.

    Args:
        summary: as `ablation.pairings_of` returns it.
    """
    if not summary.get("games_covered"):
        return None
    shown = {key: head for key, head in COLUMNS.items() if "covered" in key}
    chosen = [
        figures
        for name, figures in summary["metrics"].items()
        if name.startswith("breaches_") or name in _COVERED_SHOWN
    ]
    return _figures("Covering boats that the game drives", chosen, shown)


def _figures(title: str, metrics: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> Group:
    rows = [[one["label"], *(interval_text(one.get(key), short_limit) for key in columns)] for one in metrics]
    return titled(title, ["", *columns.values()], rows)


def verdict_table(summary: Mapping[str, Any]) -> Group | None:
    """Build the table of what the oracle says about a pairing's breaches; None where it was not asked.

    Args:
        summary: as `ablation.pairings_of` returns it.
    """
    rows = verdict_rows(summary.get("verdicts") or {}, interval_text)
    return titled("Breaches judged in hindsight", SHORT_HEADS, rows) if rows else None


def titled(
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str | Text]],
    width: int | None = None,
    wrap: bool = False,
) -> Group:
    """Lay out a table under its title: the first column words, the others numbers.

    Args:
        title: in bold above.
        heads: of the columns.
        rows: cells.
        width: of a column of numbers, at least, characters.
        wrap: whether long words of the first column go on in a second line rather than lose their end.
    """
    # the dividers alone part the columns: four columns of intervals fit 80 characters
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=0, pad_edge=False, show_header=any(heads))
    table.add_column(heads[0], no_wrap=len(heads) > 1 and not wrap)
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True, min_width=width)
    for row in rows:
        table.add_row(*row)
    return Group(Text(title, style="bold"), table)


def goals_table(goals: Sequence[Mapping[str, Any]]) -> Group:
    """Build the table of goals: what is asked, what was measured, whether it is met."""
    rows: list[list[str | Text]] = [[*goal_cells(goal), _VERDICTS[goal["met"]]] for goal in goals]
    return titled("Goals", ["", "measured", "goal", ""], rows, wrap=True)


def goal_cells(goal: Mapping[str, Any]) -> list[str]:
    """A goal's name, with what is beside it, what was measured, and what is asked."""
    name = f"{goal['name']} ({goal['note']})" if goal.get("note") else goal["name"]
    return [name, measured_text(goal), f"{goal['sense']} {number_text(goal['limit'])}"]


def interval_text(figure: Figure | None, limit_text: Callable[[float], str] | None = None) -> str:
    """Write ``value [low, high]``; a dash where there is no figure, no brackets where there are no limits.

    Args:
        figure: value, low and high.
        limit_text: how to write a limit; None writes it as the value.
    """
    if figure is None or figure["value"] is None or figure["value"] != figure["value"]:
        return "-"
    return number_text(figure["value"]) + limits_text(figure, limit_text)


def limits_text(figure: Figure, limit_text: Callable[[float], str] | None = None) -> str:
    """Write `` [low, high]``, nothing where there are no limits."""
    limits = [figure["low"], figure["high"]]
    if any(limit is None or limit != limit for limit in limits):
        return ""
    low, high = ((limit_text or number_text)(float(limit)) for limit in limits if limit is not None)
    return f" [{low}, {high}]"


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


def measured_text(bar: Mapping[str, Any]) -> str:
    """Write what was measured for a bar, with so many digits that it differs from the limit where it does."""
    value, limit = bar["value"], bar["limit"]
    text = number_text(value)
    if text == "-" or value == limit or text != number_text(limit):
        return text
    shown = (f"{value:.{digits}g}" for digits in range(2, 18))
    return next(text for text in shown if float(text) != limit)


def game_table(row: Mapping[str, Any], radii_m: Sequence[float]) -> Group:
    """Build the table of a single game.

    Args:
        row: its columns, see `metrics.GAME_COLUMNS`.
        radii_m: radii at which breaches were counted.
    """
    state = "shielded" if row["shielded"] else "not shielded"
    title = f"{row['pairing']}, {row['side']} {state}, {row['duration_s']:g} s"
    lines = [(words, row.get(name)) for name, words in _game_lines(radii_m)]
    return titled(title, ["", ""], [[words, number_text(value)] for words, value in lines if value is not None])


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
        ("collisions", "collisions scored"),
        ("primary", "primary score"),
        ("secondary", "secondary score"),
        ("policy_failures", "policy failures"),
        ("opponent_policy_failures", "opponent's policy failures"),
    ]
