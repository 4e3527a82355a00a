"""The team in one game."""

from __future__ import annotations

from ..catalogue import entrant
from ..front import BatchFront
from .batch import GENERATIONS, HORIZON, POPULATION, LucasBatch


@entrant(
    "lucas",
    "rolling-horizon evolution of macro-actions in the simulator, boat by boat (Lucas-QMU)",
    "Lucas-QMU",
    batch=LucasBatch,
)
class Lucas(BatchFront):
    """Searches with the simulator: a thin front over `LucasBatch`, whose arguments it takes."""

    name = "lucas"

    def __init__(self, population: int = POPULATION, generations: int = GENERATIONS, horizon: int = HORIZON) -> None:
        super().__init__()
        self._batch = LucasBatch(population, generations, horizon)

    @property
    def think_times_s(self) -> list[float]:
        """Times of the searches for one boat so far."""
        return self._batch.think_times_s
