"""Evolving one boat's plan while all others keep theirs."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import IntArray

from ...rollout import N_MOVES, STOP
from .model import ForwardModel

MUTATED = 3.0
"""Macro-actions of a plan that a mutation changes, on average."""


class Plans:
    """A plan per boat of both teams, evolved boat by boat.

    Args:
        model: what plans are rolled out in.
        n_boats: of both teams.
        horizon: macro-actions of a plan.
        population: plans rolled out at once.
        generations: times the best is mutated; ``population * generations`` rollouts a setting.
        rng: of mutations.
    """

    def __init__(
        self,
        model: ForwardModel,
        n_boats: int,
        horizon: int,
        population: int,
        generations: int,
        rng: np.random.Generator,
    ) -> None:
        self._model, self._rng = model, rng
        self._population, self._generations = population, generations
        self.plans: IntArray = np.full((n_boats, horizon), STOP, dtype=np.int64)

    def shift(self) -> None:
        """A macro-action has passed: drop it from every plan, repeat the last (the shift buffer)."""
        self.plans[:, :-1] = self.plans[:, 1:].copy()

    def evolve(self, boat: int, team: int, hints: IntArray) -> float:
        """Improve a boat's plan; return what the best found is worth.

        Args:
            boat: whose plan.
            team: its team.
            hints: (k,) macro-actions to try held throughout, such as straight to the flag.
        """
        best, worth = self.plans[boat].copy(), -np.inf
        for generation in range(self._generations):
            brood = self._mutants(best)
            if generation == 0:
                held = hints[: self._population - 1]
                brood[1 : 1 + len(held)] = held[:, None]
            plans = np.broadcast_to(self.plans, (self._population, *self.plans.shape)).copy()
            plans[:, boat] = brood
            self._model.play(plans)
            found = self._model.worth(team, boat)
            top = int(found.argmax())
            if found[top] > worth:
                best, worth = brood[top].copy(), float(found[top])
        self.plans[boat] = best
        return worth

    def _mutants(self, parent: IntArray) -> IntArray:
        """The parent, and mutants of it: a stretch of a plan is replaced by one macro-action."""
        brood = np.broadcast_to(parent, (self._population, parent.size)).copy()
        horizon = parent.size
        for plan in brood[1:]:
            begin = int(self._rng.integers(horizon))
            end = begin + 1 + int(self._rng.poisson(MUTATED))
            plan[begin:end] = self._rng.integers(N_MOVES)
        return brood
