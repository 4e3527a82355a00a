"""Sailing a plan: corners are cut where all cells on the straight line are open."""

from __future__ import annotations

import math

from ..plane import distance
from ..sight import Point, Sight
from .grid import Cell, GridProblem, cell_at, middle_of

STEP_M = 1.0
"""Distance at which a line is looked at, m."""


def farthest(sight: Sight, at: Point, plan: list[Cell], problem: GridProblem) -> int:
    """Number of the plan's last cell that can be made for straight away, not beyond the first one of the flag."""
    found = 0
    for number, cell in enumerate(plan):
        if number and not straight(sight, at, middle_of(sight, cell), problem):
            break
        found = number
        if cell in problem.flag and not problem.carrying:
            break
    return found


def straight(sight: Sight, a: Point, b: Point, problem: GridProblem) -> bool:
    """Whether all cells on the line from a to b are open."""
    steps = max(math.ceil(distance(a, b) / STEP_M), 1)
    points = ((a[0] + (b[0] - a[0]) * k / steps, a[1] + (b[1] - a[1]) * k / steps) for k in range(steps + 1))
    return all(problem.open_to(cell_at(sight, point)) for point in points)
