"""The team in one game."""

from __future__ import annotations

import math

from ..catalogue import entrant
from ..plane import Order
from ..play import EntrantTeam
from ..sight import Sight
from .batch import GENERATIONS, HORIZON, POPULATION, LucasBatch


@entrant(
    "lucas",
    "rolling-horizon evolution of macro-actions in the simulator, boat by boat (Lucas-QMU)",
    "Lucas-QMU",
    batch=LucasBatch,
)
class Lucas(EntrantTeam):
    """Searches with the simulator: a thin front over `LucasBatch`, whose arguments it takes."""

    name = "lucas"

    def __init__(self, population: int = POPULATION, generations: int = GENERATIONS, horizon: int = HORIZON) -> None:
        super().__init__()
        self._batch = LucasBatch(population, generations, horizon)

    @property
    def think_times_s(self) -> list[float]:
        """Times of the searches for one boat so far."""
        return self._batch.think_times_s

    def begin(self, sight: Sight) -> None:
        """Plans that stop."""
        self._batch.reset(self.core, self.team, self.seed)

    def decide(self, sight: Sight) -> list[Order]:
        """Evolve a plan when a macro-action is over, then follow the plans."""
        commands = self._batch.act(self.core, self.team)[0].tolist()
        return [
            (speed, boat.heading + math.radians(turn)) for boat, (speed, turn) in zip(sight.own, commands, strict=True)
        ]
