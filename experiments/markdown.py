"""Markdown of the pages that `steerclear docs` makes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .tables import measured_text, number_text

MADE = "<!-- made by `steerclear docs`; do not edit -->"


def table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Lines of a table: the first column words, the others numbers."""
    ruler = ["---", *("---:" for _ in heads[1:])]
    return [f"| {' | '.join(str(cell) for cell in row)} |" for row in (heads, ruler, *rows)]


def bars_table(bars: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines of the table of bars: what was measured, what is asked, whether it is met."""
    verdict = {True: "met", False: "**not met**", None: "no data"}
    rows = [
        [bar["name"], measured_text(bar), f"{bar['sense']} {number_text(bar['limit'])}", verdict[bar["met"]]]
        for bar in bars
    ]
    return table(["", "measured", "bar", ""], rows)
