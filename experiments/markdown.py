"""Markdown of the pages that `steerclear docs` makes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from steerclear.shield.foreign import visible

from .tables import goal_cells, verdict_of

MADE = "<!-- made by `steerclear docs`; do not edit -->"


def line(content: object) -> str:
    """Text of one line that a page shows as it is: no HTML, no link, nothing that turns letters round."""
    text = re.sub(r"<(?=[a-zA-Z/!?])", "&lt;", visible(content))
    return text.replace("](", "]\\(").replace("`", "\\`")


def cell(content: object) -> str:
    """Text of a table's cell: as `line`, and no bar ends it. Code in backticks is for our own words."""
    text = str(content)
    ours = text.startswith("`") and text.endswith("`") and text.count("`") == 2
    return (visible(text) if ours else line(text)).replace("|", "\\|")


def table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Lines of a table: the first column words, the others numbers."""
    ruler = ["---", *("---:" for _ in heads[1:])]
    body = [[cell(one) for one in row] for row in (heads, *rows)]
    return [f"| {' | '.join(row)} |" for row in (body[0], ruler, *body[1:])]


GOAL_HEADS = ["", "measured", "goal", ""]


def goal_row(goal: Mapping[str, Any]) -> list[str]:
    """Row of a table of goals: what was measured, what is asked, whether it is met."""
    words, _ = verdict_of(goal)
    return [*goal_cells(goal), words.replace("not met", "**not met**")]


def goals_table(goals: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines of the table of goals."""
    return table(GOAL_HEADS, list(map(goal_row, goals)))
