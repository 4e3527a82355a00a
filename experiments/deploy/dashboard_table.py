"""The dashboard's table of boats: which columns a terminal has room for, and how wide they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.table import Table

GAP = 1
"""Between columns, characters."""


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes:
        title: its head; cells are given by it.
        width: characters that its longest cell needs.
        rank: columns of higher ranks are left out first where there is no room.
        right: whether it holds numbers.
    """

    title: str
    width: int
    rank: int
    right: bool = True


COLUMNS = (
    Column("boat", 10, 0, right=False),
    Column("hdg", 4, 4),
    Column("m/s", 5, 3),
    Column("age", 5, 2),
    Column("wanted", 9, 0),
    Column("sent", 9, 0),
    Column("why", 9, 1, right=False),
    Column("margin", 6, 1),
    Column("closest", 14, 2, right=False),
    Column("bound by", 12, 5, right=False),
)
"""What was wanted and sent stands there whole in every terminal of 30 columns; a command is ``12.5 359°``."""
GROWING = (("closest", 26), ("boat", 16), ("bound by", 24), ("closest", 60))
"""Where room that is left over goes, in this order, each up to a width."""
BESIDE = sum(column.width + GAP for column in COLUMNS) + 12
"""Width with every column, ``closest`` whole: what the table has beside the map. Below it ``bound by`` is left out."""
NEVER_CUT = ("wanted", "sent")


def fitting(width: int) -> dict[str, int]:
    """Columns that a width has room for, with the width of each; what is left over goes to those that may grow."""
    shown = [column for column in COLUMNS if width >= BESIDE or column.title != "bound by"]
    while len(shown) > 1 and _needed(shown) > width:
        last = max(shown, key=lambda column: (column.rank, COLUMNS.index(column)))
        if last.rank == 0:
            break
        shown.remove(last)
    widths = {column.title: column.width for column in shown}
    left = width - _needed(shown)
    for title, most in GROWING:
        more = max(0, min(left, most - widths[title])) if title in widths else 0
        if more:
            widths[title] += more
            left -= more
    if left < 0:  # a terminal too narrow for the least: names go first
        widths["boat"] = max(1, widths["boat"] + left)
    return widths


def boats_table(width: int, rows: list[Mapping[str, Any]]) -> Table:
    """The table.

    Args:
        width: characters there are.
        rows: cells by title; those left out are empty.
    """
    widths = fitting(width)
    table = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, width=max(1, width), header_style="bold")
    for column in COLUMNS:
        if column.title in widths:
            table.add_column(
                column.title,
                width=widths[column.title],
                no_wrap=True,
                overflow="crop" if column.title in NEVER_CUT else "ellipsis",
                justify="right" if column.right else "left",
            )
    for row in rows:
        table.add_row(*(row.get(title, "") for title in widths))
    return table


def _needed(columns: list[Column]) -> int:
    return sum(column.width + GAP for column in columns)
