"""The oracle's part of a report: counts per pairing, and the breaches one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..measure.verdicts import HEADS, verdict_rows
from .page import as_text
from .tables import interval_text, number_text

MOST_BREACHES = 200
_COLUMNS = ("game", "shield", "time, s", "boats", "closest, m", "verdict", "last moment, s", "theirs, s", "responsible")


def verdict_tables(pairings: Sequence[Mapping[str, Any]]) -> str:
    """Write a table of verdicts per pairing; results of earlier versions have none."""
    tables = []
    for pairing in pairings:
        rows = verdict_rows(pairing.get("verdicts") or {}, interval_text)
        body = _table(HEADS, rows) if rows else "<p>Not judged.</p>"
        tables.append(f'<section class="card wide"><h3>{as_text(pairing["pairing"])}</h3>{body}</section>')
    return "".join(tables)


def breaches_table(breaches: Sequence[Mapping[str, Any]]) -> str:
    """Write the judged breaches, avoidable ones of shielded games first, the first ``MOST_BREACHES`` of them."""
    if not breaches:
        return ""
    order = sorted(breaches, key=lambda breach: (not breach["shielded"], breach["verdict"] != "avoidable"))
    rows = [_row(breach) for breach in order[:MOST_BREACHES]]
    more = len(order) - len(rows)
    note = f"<p class='note'>{more} more in results.json.</p>" if more > 0 else ""
    table = f'<div class="scroll">{_table(_COLUMNS, rows)}</div>{note}'
    return f'<details class="card"><summary>Every judged breach</summary>{table}</details>'


def _row(breach: Mapping[str, Any]) -> list[str]:
    who = ", ".join(breach["responsible_boats"])
    return [
        f"{breach['pairing']}, {breach['game']}",
        "on" if breach["shielded"] else "off",
        number_text(breach["time_s"]),
        ", ".join(breach["boats"]),
        number_text(breach["closest_m"]),
        breach["verdict"].replace("_", " "),
        number_text(breach["last_preventable_s"]),
        number_text(breach["other_last_preventable_s"]),
        (breach["responsible"] or "-") + (f" ({who})" if who else ""),
    ]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["".join(f"<th>{as_text(head)}</th>" for head in heads)]
    lines += ["".join(f"<td>{as_text(cell)}</td>" for cell in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
