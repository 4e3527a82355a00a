"""The team: the middle boat follows plans, the others sail circles."""

from __future__ import annotations

import math

from steerclear.shield.exceptions import PolicyError
from steerclear.shield.extras import install_command

from ..catalogue import entrant
from ..plane import STOP_MPS, Order, dock, heading_to
from ..play import EntrantTeam
from ..sight import Boat, Sight
from .follow import farthest
from .grid import Cell, GridProblem, cell_at, middle_of, problem_at
from .pddl import available
from .search import bolt, search, way_home
from .thinking import Thinking, solver_named

LOOK_S, REPLAN_S, TAKEN_S = 1.0, 5.0, 0.5
"""How often the boat looks whether its plan still holds, makes a new one anyhow, and how long it thinks, s."""
CONTACT_SHARES = (2.0, 1.6, 1.3, 1.0, 0.8)
"""Distances that count as contact, in tag radii: the first that leaves a way. Opponents move while the plan is sailed,
hence more than the radius where there is room; less than it is a gamble, taken where all else is shut."""
CIRCLE_DEG = 45.0
CIRCLE_SHARE = 0.5
"""Of top speed, at which teammates sail their circles."""
PLANNERS = ("auto", "pddl", "astar")


@entrant("chao", "the middle boat plans on a grid (PDDL+, or A*), mates sail circles (Chao-NIWC-PAC)", "Chao-NIWC-PAC")
class Chao(EntrantTeam):
    """Plans for its middle boat.

    Args:
        planner: "pddl" (extra ``[plan]``), "astar", or "auto" for the first that is there.
        contact_m: distance to an opponent that counts as contact in plans, m; None for `CONTACT_SHARES`.

    Raises:
        PolicyError: an unknown planner, one that is not installed, or a distance that is none.
    """

    name = "chao"

    def __init__(self, planner: str = "auto", contact_m: float | None = None) -> None:
        super().__init__()
        if planner not in PLANNERS:
            raise PolicyError(f"planner is {planner!r}; choose from {', '.join(PLANNERS)}")
        if planner == "pddl" and not available():
            raise PolicyError(f'the PDDL+ planner is not installed; {install_command("plan")}, or planner="astar"')
        if contact_m is not None and not 0.0 <= contact_m < math.inf:
            raise PolicyError(f"contact_m is {contact_m!r}; give a distance in m, 0 or more")
        self.planner = ("pddl" if available() else "astar") if planner == "auto" else planner
        self._contact_m = contact_m
        self._thinking: Thinking | None = None

    def begin(self, sight: Sight) -> None:
        """Nothing is planned."""
        self.close()
        self._thinking = Thinking(solver_named(self.planner))
        self._middle, self._plan, self._step, self._aim = len(sight.own) // 2, [], -1, None
        self._planned_s, self._carried = -math.inf, False
        self._every, self._later = max(round(LOOK_S / self.dt_s), 2), max(round(TAKEN_S / self.dt_s), 1)
        self._later = min(self._later, self._every - 1)

    def decide(self, sight: Sight) -> list[Order]:
        """Plan now and then, follow the plan, let the others circle."""
        self._step += 1
        self._think(sight)
        return [
            self._follow(sight) if number == self._middle else circling(boat, number < self._middle)
            for number, boat in enumerate(sight.own)
        ]

    @property
    def missed_deadlines(self) -> int:
        """Plans that came too late in this game."""
        return 0 if self._thinking is None else self._thinking.missed

    @property
    def think_times_s(self) -> list[float]:
        """How long each plan of this game took, s."""
        return [] if self._thinking is None else self._thinking.times_s

    def close(self) -> None:
        """End the planner's thread."""
        if self._thinking is not None:
            self._thinking.close()

    def _think(self, sight: Sight) -> None:
        assert self._thinking is not None  # begin() made it
        phase = self._step % self._every
        if phase == 0 and not sight.own[self._middle].tagged:
            self._aim = None  # what stood in the way may be gone
            self._problem = self._now(sight)
            if not self._plan_holds(self._problem) or sight.time - self._planned_s >= REPLAN_S:
                self._planned_s = sight.time
                self._thinking.ask(self._problem)
        elif phase == self._later:
            answered = self._thinking.answer(self._plan or None)
            if answered is not None:
                self._plan, self._aim = _plan_of(*answered), None

    def _now(self, sight: Sight) -> GridProblem:
        """The problem with the widest contacts that leave a way, with the least where none does."""
        given = self._contact_m
        radii = [share * sight.reach for share in CONTACT_SHARES] if given is None else [given]
        for radius in radii:
            problem = problem_at(sight, self._middle, radius)
            if search(problem) is not None:
                break
        return problem

    def _plan_holds(self, problem: GridProblem) -> bool:
        """Whether the plan goes on and through open cells, with the flag in the same hands as when it was made."""
        same, self._carried = self._carried == problem.carrying, problem.carrying
        return bool(self._plan) and same and all(problem.open_to(cell) for cell in self._plan)

    def _follow(self, sight: Sight) -> Order:
        boat = sight.own[self._middle]
        here, at = cell_at(sight, boat.at), dock(boat, sight)
        if boat.carries and boat.on_side and at is not None:
            return boat.top, heading_to(boat.at, at)  # in the own zone nobody tags it: plans end at the line
        if here in self._plan[: 1 if self._aim is None else self._aim + 1]:
            self._plan, self._aim = self._plan[self._plan.index(here) + 1 :], None
        if not self._plan:
            return STOP_MPS, boat.heading
        if self._aim is None:
            self._aim = farthest(sight, boat.at, self._plan, self._problem)
        return boat.top, heading_to(boat.at, middle_of(sight, self._plan[self._aim]))


def _plan_of(problem: GridProblem, plan: list[Cell] | None) -> list[Cell]:
    """The cells to sail: the plan's; with no way to a capture the way home, with the flag even through contacts."""
    plan = plan if plan is not None else search(problem)
    plan = plan if plan is not None else way_home(problem)
    return list(plan if plan is not None else bolt(problem) if problem.carrying else [])


def circling(boat: Boat, to_port: bool) -> Order:
    """A constant turn, to one side for boats above the planner and to the other below."""
    turn = math.radians(-CIRCLE_DEG if to_port else CIRCLE_DEG)
    return CIRCLE_SHARE * boat.top, boat.heading + turn
