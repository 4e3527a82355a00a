"""Counting the oracle's verdicts: columns of a game, summary of a pairing, lines for tables and reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from .judging import NOT_JUDGED, OUTCOMES
from .statistics import count_interval

Row = Mapping[str, Any]
KINDS = (("teammate", "team-mate"), ("opponent", "opponent"))
SIDES = ("own", "opponent", "both", "game", "neither", "start")
_STATES = ((False, "off"), (True, "on"))
_COUNTED = (*OUTCOMES, NOT_JUDGED)
HEADS = ("", "breaches", "avoidable", "unavoidable", "started inside", "not judged", "avoidable per game")
SHORT_HEADS = ("", "breaches", "avoidable", "unavoid.", "inside", "unjudged", "avoidable/game")


def verdict_column(verdict: str, kind: str, radius_m: float) -> str:
    """Name the column of a count: `avoidable_opponent_2.5m`."""
    return f"{verdict}_{kind}_{float(radius_m)}m"


def verdict_columns(breaches: Sequence[Row] | None, radius_m: float) -> dict[str, int | None]:
    """Count a game's verdicts per kind of pair.

    Args:
        breaches: as `judging.judge_game` returns them; None when the game was not judged.
        radius_m: at which they were.

    Returns:
        A count per outcome and kind; None in all when the game was not judged.
    """
    return {
        verdict_column(verdict, kind, radius_m): None if breaches is None else _number(breaches, kind, verdict)
        for kind, _ in KINDS
        for verdict in _COUNTED
    }


def summarise_verdicts(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise the verdicts of a pairing's games.

    Args:
        rows: games; those without ``breaches`` (stored by an earlier version, or not asked for) were not judged.

    Returns:
        Per shield state off and on: ``games`` and ``games_judged``; per kind the number of breaches per outcome,
        ``breaches``, ``avoidable_per_game`` (value, low, high; None when no game was judged) and ``responsible``
        (number per side).
    """
    summary = {}
    for shielded, state in _STATES:
        games = [row for row in rows if bool(row["shielded"]) is shielded]
        judged = [row["breaches"] for row in games if row.get("breaches") is not None]
        found = [breach for breaches in judged for breach in breaches]
        kinds = {kind: _kind(found, kind, len(judged)) for kind, _ in KINDS}
        summary[state] = {"games": len(games), "games_judged": len(judged), **kinds}
    return summary


def _kind(breaches: Sequence[Row], kind: str, games: int) -> dict[str, Any]:
    counts = {verdict: _number(breaches, kind, verdict) for verdict in _COUNTED}
    sides = [breach["responsible"] for breach in breaches if breach["kind"] == kind]
    return {
        "breaches": sum(counts.values()),
        **counts,
        "avoidable_per_game": asdict(count_interval(counts["avoidable"], games)) if games else None,
        "responsible": {side: sides.count(side) for side in SIDES},
    }


def _number(breaches: Sequence[Row], kind: str, verdict: str) -> int:
    return sum(breach["kind"] == kind and breach["verdict"] == verdict for breach in breaches)


def all_breaches(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """List the breaches of all judged games, each with the game it happened in."""
    named = ("pairing", "game", "shielded")
    return [{**{name: row[name] for name in named}, **breach} for row in rows for breach in row.get("breaches") or ()]


def without_breaches(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the rows without their lists of breaches: flat, as tables need them."""
    return [{name: value for name, value in row.items() if name != "breaches"} for row in rows]


def verdict_rows(verdicts: Mapping[str, Any], interval_text: Any) -> list[list[str]]:
    """Lay out a summary of verdicts, a line per shield state and kind, under `HEADS`.

    There are none where no game was judged.

    Args:
        verdicts: as `summarise_verdicts` returns them; empty for results of an earlier version.
        interval_text: writes a figure.
    """
    lines: list[list[str]] = []
    if not any((verdicts.get(state) or {}).get("games_judged") for _, state in _STATES):
        return lines
    for state in ("off", "on"):
        part = verdicts.get(state) or {}
        if part.get("games"):
            lines += [_line(state, part, kind, words, interval_text) for kind, words in KINDS]
    return lines


def _line(state: str, part: Mapping[str, Any], kind: str, words: str, interval_text: Any) -> list[str]:
    label = f"{words}, {state}"
    if not part["games_judged"]:
        return [label, "not judged", *["-"] * (len(HEADS) - 2)]
    counts = part[kind]
    numbers = [str(counts[name]) for name in ("breaches", *_COUNTED)]
    return [label, *numbers, interval_text(counts["avoidable_per_game"])]
