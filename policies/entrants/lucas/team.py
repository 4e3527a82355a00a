"""The team: at every macro-action one boat's plan is evolved, own and opposing boats in alternation."""

from __future__ import annotations

import math
import time

import numpy as np
from steerclear.shield.exceptions import PolicyError

from ...rollout import HEADINGS, STOP
from ..catalogue import entrant
from ..plane import STOP_MPS, Order, distance, heading_to, wrap
from ..play import EntrantTeam
from ..sight import Boat, Sight
from .evolution import Plans
from .model import ForwardModel, Weights, home_of

MOVE_S = 1.2
HORIZON = 15
POPULATION, GENERATIONS = 15, 4
KEEP_OFF_M = 5.0
"""Rule: a boat nearer than this to another, and closing, turns away from it."""


@entrant("lucas", "rolling-horizon evolution of macro-actions in the simulator, boat by boat (Lucas-QMU)", "Lucas-QMU")
class Lucas(EntrantTeam):
    """Searches with the simulator.

    Args:
        population: plans rolled out at once.
        generations: broods of a setting.
        horizon: macro-actions of a plan.

    Raises:
        PolicyError: a number that is none, or below 2, 1 and 1.
    """

    name = "lucas"

    def __init__(self, population: int = POPULATION, generations: int = GENERATIONS, horizon: int = HORIZON) -> None:
        super().__init__()
        given = (("population", population, 2), ("generations", generations, 1), ("horizon", horizon, 1))
        for word, number, least in given:
            if isinstance(number, bool) or not isinstance(number, int) or not least <= number <= 1000:
                raise PolicyError(f"{word} is {number!r}; give a whole number from {least} to 1000")
        self._population, self._generations, self._horizon = population, generations, horizon
        self.think_times_s: list[float] = []

    def begin(self, sight: Sight) -> None:
        """Plans that stop, and the order in which they are evolved."""
        core = self.core
        model = ForwardModel(core, self._population, MOVE_S, Weights())
        rng = np.random.default_rng([self.seed & 0x7FFFFFFF, 0x10CA5])
        self._plans = Plans(model, core.n_boats, self._horizon, self._population, self._generations, rng)
        size = len(sight.own)
        self._first = self.team * size
        others = (1 - self.team) * size
        self._turns = [boat for k in range(size) for boat in (self._first + k, others + k)]
        self._step, self._every = -1, max(round(MOVE_S / self.dt_s), 1)
        self.think_times_s = []

    def decide(self, sight: Sight) -> list[Order]:
        """Evolve a plan when a macro-action is over, then follow the plans."""
        self._step += 1
        move, within = divmod(self._step, self._every)
        if within == 0:
            self._think(move)
        return [self._order(sight, number) for number in range(len(sight.own))]

    def _think(self, move: int) -> None:
        begun = time.perf_counter()
        if move:
            self._plans.shift()
        boats = self._turns if move == 0 else [self._turns[move % len(self._turns)]]
        for boat in boats:
            self._plans.evolve(boat, int(self.core.team[boat]), self._hints(boat))
        self.think_times_s.append((time.perf_counter() - begun) / len(boats))

    def _hints(self, boat: int) -> np.ndarray:
        """Macro-actions straight to the other flag and home, and a stop."""
        place, team = self.core.state[0, boat, :2], int(self.core.team[boat])
        aims = (self.core.flag_position[0, 1 - team], home_of(self.core, team, boat))
        headings = [math.degrees(math.atan2(aim[0] - place[0], aim[1] - place[1])) for aim in aims]
        return np.array([*(round(heading / 45.0) % HEADINGS for heading in headings), STOP], dtype=np.int64)

    def _order(self, sight: Sight, number: int) -> Order:
        boat = sight.own[number]
        action = int(self._plans.plans[self._first + number, 0])
        near = closing(sight, number)
        if near is not None:
            return boat.top, heading_to(near.at, boat.at)
        if action == STOP:
            return STOP_MPS, boat.heading
        return boat.top, math.radians(45.0 * action) + self._turn


def closing(sight: Sight, number: int) -> Boat | None:
    """The nearest boat that is too near and not astern; None where there is none."""
    boat = sight.own[number]
    others = [*(mate for k, mate in enumerate(sight.own) if k != number), *sight.foes]
    near = min(others, key=lambda other: distance(boat.at, other.at))
    if distance(boat.at, near.at) > KEEP_OFF_M:
        return None
    return near if abs(wrap(heading_to(boat.at, near.at) - boat.heading)) < 0.5 * math.pi else None
