"""Markdown of the pages that `steerclear docs` makes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

MADE = "<!-- made by `steerclear docs`; do not edit -->"


def table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Lines of a table: the first column words, the others numbers."""
    ruler = ["---", *("---:" for _ in heads[1:])]
    return [f"| {' | '.join(str(cell) for cell in row)} |" for row in (heads, ruler, *rows)]
