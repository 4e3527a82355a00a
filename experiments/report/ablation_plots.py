"""The plots of an ablation's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .svg import Bar, bar_plot, dot_plot, share_plot
from .tables import interval_text

Summary = Mapping[str, Any]
Row = Mapping[str, Any]
STATES = ("off", "on")
PASSED = "passed"


def figure_plot(pairings: Sequence[Summary], metric: str, axis: str, reference: float | None = None) -> str:
    """Draw a figure of every pairing, without and with the shield.

    Args:
        pairings: As `summary.summarise` returns them.
        metric: Name of the figure.
        axis: Text of the axis.
        reference: A value to mark.

    Returns:
        An ``svg`` element.
    """
    groups = [
        (pairing["pairing"], [_bar(state, figures[state]) for state in STATES if state in figures])
        for pairing in pairings
        for figures in [pairing["metrics"][metric]]
    ]
    return bar_plot(groups, axis, reference)


def closest_plot(pairings: Sequence[Summary], games: Sequence[Row], separation_m: float) -> str:
    """Draw the closest distance of every game as a dot.

    Args:
        pairings: As `summary.summarise` returns them.
        games: Rows of games.
        separation_m: Radius to mark.

    Returns:
        An ``svg`` element.
    """
    groups = []
    for pairing in pairings:
        name = pairing["pairing"]
        rows = [(state, _closest(games, name, state == "on")) for state in STATES]
        groups.append((name, [(state, values) for state, values in rows if values]))
    return dot_plot(groups, "closest distance in each game, m", separation_m)


def reason_plot(pairings: Sequence[Summary]) -> tuple[str, list[tuple[str, str]]]:
    """Draw why commands were changed, as shares of all commands the shield decided.

    Args:
        pairings: As `summary.summarise` returns them.

    Returns:
        An ``svg`` element and its legend: class and name of each reason.
    """
    names = reasons_of(pairings)
    styles = {name: f"reason-{k}" for k, name in enumerate(names)}
    groups = []
    for pairing in pairings:
        counts = pairing["reasons"]
        total = sum(counts.values())
        if total:
            parts = [(styles[name], words(name), 100.0 * counts.get(name, 0) / total) for name in names]
            groups.append((pairing["pairing"], parts))
    return share_plot(groups, "commands the shield changed, % of all it decided"), [
        (styles[name], words(name)) for name in names
    ]


def reasons_of(pairings: Sequence[Summary]) -> list[str]:
    """Names of the reasons for which commands were changed."""
    return [name for name in dict.fromkeys(n for p in pairings for n in p["reasons"]) if name.lower() != PASSED]


def words(name: str) -> str:
    """Return a reason's name as words."""
    return name.replace("_", " ").lower().replace("qp", "QP")


def _bar(state: str, figure: Mapping[str, float | None]) -> Bar:
    value, low, high = (number(figure.get(name)) for name in ("value", "low", "high"))
    return Bar(state, value, low, high, interval_text({"value": value, "low": None, "high": None}))


def number(value: float | None) -> float | None:
    """Return the value, None where it is missing or not a number."""
    return None if value is None or value != value else float(value)


def _closest(games: Sequence[Row], pairing: str, shielded: bool) -> list[float]:
    chosen = (row for row in games if row["pairing"] == pairing and bool(row["shielded"]) is shielded)
    found = (number(row["closest_m"]) for row in chosen)
    return [value for value in found if value is not None]
