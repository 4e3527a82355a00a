"""Chao-NIWC-PAC: one boat plans on a grid, its teammates sail circles.

From the paper: planning on a grid (by PDDL+) with four moves; grabs and contacts are events; opponents are static. The
goal is a capture or to be back in the own zone. Only the middle boat plans, and replans during the game. In the entry's
public code teammates are obstacles and sail constant turns.

Our additions: 16 x 8 cells, searched by A*. A cell is watched if its middle is near an opponent that may tag; how near
is the widest of `CONTACT_SHARES` that leaves a path. Corners of a plan are cut where all cells on the line are open.
The boat replans when the last plan has ended, leads through a cell that is watched or blocked, or is `REPLAN_S` old.
The new plan takes effect `TAKEN_S` later.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from steerclear.shield.exceptions import PolicyError

from .catalogue import entrant
from .observation import Boat, Observation, Point
from .plane import STOP_MPS, Order, distance, dock, heading_to
from .play import EntrantTeam

Cell = tuple[int, int]
State = tuple[Cell, bool]
"""A cell, and whether the boat has had the flag before it."""
Node = TypeVar("Node", Cell, State)
COLUMNS, ROWS = 16, 8
LOOK_S, REPLAN_S, TAKEN_S = 1.0, 5.0, 0.5
"""Times, s: between checks of the plan, until a new plan is made in any case, and for thinking."""
CONTACT_SHARES = (2.0, 1.6, 1.3, 1.0, 0.8)
"""Contact distances in tag radii; the first that leaves a path is used. Opponents move during a plan, hence more than
the radius where possible; less is a gamble for when all other paths are shut.
"""
CIRCLE_DEG, CIRCLE_SHARE = 45.0, 0.5
"""Turn of the teammates, and share of their top speed."""
STEP_M = 1.0
"""Distance between checked points of a line, m."""
PLANNERS = ("auto", "astar")


@dataclass(frozen=True)
class GridProblem:
    """A planning problem.

    Attributes:
        start: the boat's cell.
        carrying: the boat has the flag.
        flag: cells from which the flag can be grabbed.
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

    def is_open(self, cell: Cell) -> bool:
        """Return whether the boat may move to a cell: in the field, without teammate or contact."""
        inside = 0 <= cell[0] < COLUMNS and 0 <= cell[1] < ROWS
        return inside and cell not in self.blocked and cell not in self.watched

    def beside(self, cell: Cell) -> list[Cell]:
        """Return the open cells that the four moves lead to."""
        moves = ((1, 0), (-1, 0), (0, 1), (0, -1))
        return [to for x, y in moves if self.is_open(to := (cell[0] + x, cell[1] + y))]


def cell_at(obs: Observation, point: Point) -> Cell:
    """Return the cell of a point; for one outside the field, the nearest cell."""
    column, row = int(point[0] / obs.size[0] * COLUMNS), int(point[1] / obs.size[1] * ROWS)
    return min(max(column, 0), COLUMNS - 1), min(max(row, 0), ROWS - 1)


def middle_of(obs: Observation, cell: Cell) -> Point:
    """Return the middle of a cell, m."""
    return (cell[0] + 0.5) * obs.size[0] / COLUMNS, (cell[1] + 0.5) * obs.size[1] / ROWS


def problem_at(obs: Observation, planner: int, contact_m: float) -> GridProblem:
    """Return the problem of an own boat; watched are cells within ``contact_m`` of an opponent that may tag."""
    boat, own = obs.own[planner], int(obs.line / obs.size[0] * COLUMNS)
    start = cell_at(obs, boat.at)
    mates = {cell_at(obs, mate.at) for number, mate in enumerate(obs.own) if number != planner}
    taggers = [foe.at for foe in obs.foes if _may_tag(foe, obs)]
    # the cell on the line counts as foreign: the zone begins where a boat is certainly inside
    cells = [((column, row), middle_of(obs, (column, row))) for column in range(own, COLUMNS) for row in range(ROWS)]
    watched = {cell for cell, middle in cells if any(distance(middle, at) <= contact_m for at in taggers)}
    flag = frozenset(cell for cell, middle in cells if distance(middle, obs.goal) < obs.reach)
    return GridProblem(start, boat.carries, flag, own, frozenset(mates - {start}), frozenset(watched - {start}))


def _may_tag(foe: Boat, obs: Observation) -> bool:
    """Return whether an opponent may tag now or when a boat arrives: near its base a tagged one is soon free."""
    soon_free = distance(foe.at, obs.base) < 2.0 * obs.reach
    return foe.recharged and foe.on_side and (soon_free or not foe.tagged)


def search(problem: GridProblem) -> list[Cell] | None:
    """Return the shortest path to the flag and back into the own zone, by A*; None if there is none."""
    start: State = (problem.start, problem.carrying or problem.start in problem.flag)
    came: dict[State, State] = {}
    cost, queue = {start: 0}, [(_least(problem, start), start)]
    while queue:
        _, state = heapq.heappop(queue)
        here, carrying = state
        if carrying and here[0] < problem.own:
            return [cell for cell, _ in _trace(came, state)]
        for cell in problem.beside(here):
            following = cell, carrying or cell in problem.flag
            if cost[state] + 1 < cost.get(following, 10**9):
                cost[following], came[following] = cost[state] + 1, state
                heapq.heappush(queue, (cost[following] + _least(problem, following), following))
    return None


def _least(problem: GridProblem, state: State) -> int:
    """Return a lower bound on the moves left: to the flag's columns if the boat lacks the flag, then home."""
    (column, _), carrying = state
    if carrying:
        return max(column - problem.own + 1, 0)
    nearest = min((cell[0] for cell in problem.flag), default=column)
    return max(nearest - column, 0) + max(nearest - problem.own + 1, 0)


def way_home(problem: GridProblem) -> list[Cell] | None:
    """Return the shortest path into the own zone; None if none is open."""
    came: dict[Cell, Cell] = {}
    seen, edge = {problem.start}, [problem.start]
    while edge:
        inside = next((cell for cell in edge if cell[0] < problem.own), None)
        if inside is not None:
            return _trace(came, inside)
        further = []
        for cell in edge:
            for to in problem.beside(cell):
                if to not in seen:
                    seen.add(to)
                    came[to] = cell
                    further.append(to)
        edge = further
    return None


def bolt(problem: GridProblem) -> list[Cell]:
    """Return the cells straight into the own zone, whatever is in the way."""
    column, row = problem.start
    return [(to, row) for to in range(column - 1, problem.own - 2, -1)]


def _trace(came: Mapping[Node, Node], end: Node) -> list[Node]:
    """Return the path to an end, without the start."""
    found = []
    while end in came:
        found.append(end)
        end = came[end]
    return found[::-1]


def _planned(problem: GridProblem) -> list[Cell]:
    """Return the cells to sail: to a capture, otherwise home; with the flag even through contacts."""
    for plan in (search, way_home):
        if (found := plan(problem)) is not None:
            return found
    return bolt(problem) if problem.carrying else []


def _farthest(obs: Observation, at: Point, plan: list[Cell], problem: GridProblem) -> int:
    """Return the last cell of the plan that a straight line reaches, at most the first one of the flag."""
    found = 0
    for number, cell in enumerate(plan):
        if number and not _straight(obs, at, middle_of(obs, cell), problem):
            break
        found = number
        if cell in problem.flag and not problem.carrying:
            break
    return found


def _straight(obs: Observation, a: Point, b: Point, problem: GridProblem) -> bool:
    """Return whether all cells on the line from a to b are open."""
    steps = max(math.ceil(distance(a, b) / STEP_M), 1)
    points = ((a[0] + (b[0] - a[0]) * k / steps, a[1] + (b[1] - a[1]) * k / steps) for k in range(steps + 1))
    return all(problem.is_open(cell_at(obs, point)) for point in points)


@entrant("chao", "the middle boat plans on a grid, by A*, mates sail circles (Chao-NIWC-PAC)", "Chao-NIWC-PAC")
class Chao(EntrantTeam):
    """Plans for its middle boat.

    Args:
        planner: "astar" or "auto", which means the same.
        contact_m: distance to an opponent that counts as contact in plans, m; None for `CONTACT_SHARES`.

    Attributes:
        think_times_s: time for each plan of this game, s.

    Raises:
        PolicyError: an unknown planner, or an invalid distance.
    """

    name = "chao"

    def __init__(self, planner: str = "auto", contact_m: float | None = None) -> None:
        super().__init__()
        if planner not in PLANNERS:
            raise PolicyError(f"planner is {planner!r}; choose from {', '.join(PLANNERS)}")
        if contact_m is not None and not 0.0 <= contact_m < math.inf:
            raise PolicyError(f"contact_m is {contact_m!r}; give a distance in m, 0 or more")
        self._contact_m = contact_m
        self.think_times_s: list[float] = []

    def begin(self, obs: Observation) -> None:
        """Begin a game without a plan."""
        self.think_times_s = []
        self._middle, self._plan, self._step = len(obs.own) // 2, list[Cell](), -1
        self._aim: int | None = None
        self._asked: GridProblem | None = None
        self._planned_s, self._carried = -math.inf, False
        self._every = max(round(LOOK_S / self.dt_s), 2)
        self._later = min(max(round(TAKEN_S / self.dt_s), 1), self._every - 1)

    def decide(self, obs: Observation) -> list[Order]:
        """Replan at times, follow the plan, and let the teammates circle.

        Those before the planner circle to one side, the others to the other.
        """
        self._step += 1
        self._think(obs)
        turns = [math.radians(-CIRCLE_DEG if number < self._middle else CIRCLE_DEG) for number in range(len(obs.own))]
        orders = [(CIRCLE_SHARE * boat.top, boat.heading + turn) for boat, turn in zip(obs.own, turns, strict=True)]
        orders[self._middle] = self._follow(obs)
        return orders

    def _think(self, obs: Observation) -> None:
        phase = self._step % self._every
        if phase == 0 and not obs.own[self._middle].tagged:
            self._aim = None  # obstacles may have gone
            self._problem = self._now(obs)
            if not self._plan_holds(self._problem) or obs.time - self._planned_s >= REPLAN_S:
                self._planned_s, self._asked = obs.time, self._problem
        elif phase == self._later and self._asked is not None:
            begun = time.perf_counter()
            self._plan, self._aim, self._asked = _planned(self._asked), None, None
            self.think_times_s.append(time.perf_counter() - begun)

    def _now(self, obs: Observation) -> GridProblem:
        """Return the problem with the widest contacts that leave a path; with the least if none does."""
        given = self._contact_m
        for radius in [share * obs.reach for share in CONTACT_SHARES] if given is None else [given]:
            problem = problem_at(obs, self._middle, radius)
            if search(problem) is not None:
                break
        return problem

    def _plan_holds(self, problem: GridProblem) -> bool:
        """Return whether the plan has cells left, all open, and the flag is held or free as when it was made."""
        same, self._carried = self._carried == problem.carrying, problem.carrying
        return bool(self._plan) and same and all(map(problem.is_open, self._plan))

    def _follow(self, obs: Observation) -> Order:
        boat = obs.own[self._middle]
        here, at = cell_at(obs, boat.at), dock(boat, obs)
        if boat.carries and boat.on_side and at is not None:
            return boat.top, heading_to(boat.at, at)  # nobody tags it in the own zone: plans end at the line
        if here in self._plan[: 1 if self._aim is None else self._aim + 1]:
            self._plan, self._aim = self._plan[self._plan.index(here) + 1 :], None
        if not self._plan:
            return STOP_MPS, boat.heading
        if self._aim is None:
            self._aim = _farthest(obs, boat.at, self._plan, self._problem)
        return boat.top, heading_to(boat.at, middle_of(obs, self._plan[self._aim]))
