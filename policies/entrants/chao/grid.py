"""The grid the planning boat thinks on: cells, what stands in them, and the problem at a moment."""

from __future__ import annotations

from dataclasses import dataclass

from ..plane import distance
from ..sight import Boat, Point, Sight

COLUMNS, ROWS = 16, 8
MOVES = ((1, 0), (-1, 0), (0, 1), (0, -1))
Cell = tuple[int, int]


@dataclass(frozen=True)
class GridProblem:
    """What is to be planned; equal problems have equal plans.

    Attributes:
        start: the boat's cell.
        carrying: whether it has the flag.
        flag: cells from which the flag is grabbed.
        own: columns below this one are the own zone.
        blocked: cells of teammates.
        watched: cells in which an opponent makes contact.
    """

    start: Cell
    carrying: bool
    flag: frozenset[Cell]
    own: int
    blocked: frozenset[Cell]
    watched: frozenset[Cell]

    def open_to(self, cell: Cell) -> bool:
        """Whether the boat may move to a cell: in the field, no mate and no contact there."""
        inside = 0 <= cell[0] < COLUMNS and 0 <= cell[1] < ROWS
        return inside and cell not in self.blocked and cell not in self.watched


def beside(cell: Cell) -> list[Cell]:
    """Where the four moves lead, the field's edges not looked at."""
    return [(cell[0] + column, cell[1] + row) for column, row in MOVES]


def cell_at(sight: Sight, point: Point) -> Cell:
    """The cell of a point; of one outside the field the nearest."""
    column = int(point[0] / sight.size[0] * COLUMNS)
    row = int(point[1] / sight.size[1] * ROWS)
    return min(max(column, 0), COLUMNS - 1), min(max(row, 0), ROWS - 1)


def middle_of(sight: Sight, cell: Cell) -> Point:
    """The middle of a cell, m."""
    return (cell[0] + 0.5) * sight.size[0] / COLUMNS, (cell[1] + 0.5) * sight.size[1] / ROWS


def problem_at(sight: Sight, planner: int, contact_m: float) -> GridProblem:
    """The problem of one own boat.

    Args:
        sight: the moment.
        planner: number of the boat that plans.
        contact_m: a cell is watched when its middle is this near to an opponent that may tag, m.
    """
    boat = sight.own[planner]
    cells = [(column, row) for column in range(COLUMNS) for row in range(ROWS)]
    start = cell_at(sight, boat.at)
    mates = {cell_at(sight, mate.at) for number, mate in enumerate(sight.own) if number != planner}
    taggers = [foe for foe in sight.foes if _may_tag(foe, sight)]
    # the middle of the cell on the line counts as foreign: the zone begins where a boat surely is inside
    own = int(sight.line / sight.size[0] * COLUMNS)
    watched = {
        cell
        for cell in cells
        if cell[0] >= own and any(distance(middle_of(sight, cell), foe.at) <= contact_m for foe in taggers)
    }
    flag = {cell for cell in cells if cell[0] >= own and distance(middle_of(sight, cell), sight.goal) < sight.reach}
    return GridProblem(
        start, boat.carries, frozenset(flag), own, frozenset(mates - {start}), frozenset(watched - {start})
    )


def _may_tag(foe: Boat, sight: Sight) -> bool:
    """Whether it may tag now, or will by the time a boat is there: near its base a tagged one is soon free again."""
    soon_free = distance(foe.at, sight.base) < 2.0 * sight.reach
    return foe.recharged and foe.on_side and (soon_free or not foe.tagged)
