"""A* on the same grid: the shortest way to the flag and back into the own zone, without contact."""

from __future__ import annotations

import heapq

from .grid import Cell, GridProblem, beside

State = tuple[Cell, bool]


def search(problem: GridProblem) -> list[Cell] | None:
    """Cells to move through, in order; None where no way leads to a capture (with the flag: home)."""
    start: State = (problem.start, problem.carrying or problem.start in problem.flag)
    if start[1] and problem.start[0] < problem.own:
        return []
    came: dict[State, State] = {}
    cost = {start: 0}
    queue = [(_least(problem, start), start)]
    while queue:
        _, state = heapq.heappop(queue)
        if state[1] and state[0][0] < problem.own:
            return _way(came, state)
        for following in _following(problem, state):
            if cost[state] + 1 < cost.get(following, 10**9):
                cost[following], came[following] = cost[state] + 1, state
                heapq.heappush(queue, (cost[following] + _least(problem, following), following))
    return None


def way_home(problem: GridProblem) -> list[Cell] | None:
    """The shortest way into the own zone; None where none is open."""
    came: dict[Cell, Cell] = {}
    seen, edge = {problem.start}, [problem.start]
    while edge:
        inside = next((cell for cell in edge if cell[0] < problem.own), None)
        if inside is not None:
            return [cell for cell, _ in _pairs(came, inside)]
        further = []
        for cell in edge:
            for to in beside(cell):
                if to not in seen and problem.open_to(to):
                    seen.add(to)
                    came[to] = cell
                    further.append(to)
        edge = further
    return None


def bolt(problem: GridProblem) -> list[Cell]:
    """Straight into the own zone, whatever is in the way."""
    column, row = problem.start
    return [(to, row) for to in range(column - 1, problem.own - 2, -1)]


def _following(problem: GridProblem, state: State) -> list[State]:
    here, carrying = state
    return [(cell, carrying or cell in problem.flag) for cell in beside(here) if problem.open_to(cell)]


def _least(problem: GridProblem, state: State) -> int:
    """A lower bound on the moves left: to the flag's columns where it is still to be had, then home."""
    (column, _), carrying = state
    if carrying:
        return max(column - problem.own + 1, 0)
    nearest = min((cell[0] for cell in problem.flag), default=column)
    return max(nearest - column, 0) + max(nearest - problem.own + 1, 0)


def _way(came: dict[State, State], end: State) -> list[Cell]:
    cells = []
    while end in came:
        cells.append(end[0])
        end = came[end]
    return cells[::-1]


def _pairs(came: dict[Cell, Cell], end: Cell) -> list[tuple[Cell, Cell]]:
    found = []
    while end in came:
        found.append((end, came[end]))
        end = came[end]
    return found[::-1]
