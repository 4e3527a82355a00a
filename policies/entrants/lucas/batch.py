"""The team in every game of a batch: at every macro-action one boat's plan is evolved, own and opposing in turn."""

from __future__ import annotations

import time

import numpy as np
from steerclear.env.arrays import make_rules
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_geometry
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray

from ...evolve import evolve
from ...follow import follow_plans
from ...rollout import STOP, make_desk
from .home import hints_for, home_of

MOVE_S = 1.2
HORIZON = 15
POPULATION, GENERATIONS = 15, 4
STEP_S = 0.2
"""Step of the forward model, s: twice the game's, which costs a tenth of a metre over a plan and halves the time."""


class LucasBatch:
    """A `BatchPolicy` that searches with the simulator, in one game after another.

    Args:
        population: plans of a generation.
        generations: times the best plan is mutated in a search.
        horizon: macro-actions of a plan.

    Attributes:
        think_times_s: of the searches for one boat so far.

    Raises:
        PolicyError: a number that is none, or below 2, 1 and 1.
    """

    name = "lucas"

    def __init__(self, population: int = POPULATION, generations: int = GENERATIONS, horizon: int = HORIZON) -> None:
        given = (("population", population, 2), ("generations", generations, 1), ("horizon", horizon, 1))
        for word, number, least in given:
            if isinstance(number, bool) or not isinstance(number, int) or not least <= number <= 1000:
                raise PolicyError(f"{word} is {number!r}; give a whole number from {least} to 1000")
        self._population, self._generations, self._horizon = population, generations, horizon
        self._team, self._mine = -1, np.zeros(0, np.bool_)
        self.think_times_s: list[float] = []

    def reset(self, core: BatchedMctf, team: int, seed: int) -> None:
        """Begin all games, with plans that stop."""
        model = _forward_model(core.config)
        self._rules = make_rules(model, field_geometry(model))
        self._desk = make_desk(model, self._population, self._generations, self._horizon, MOVE_S)
        self._team, self._own = team, np.flatnonzero(core.team == team)
        others = np.flatnonzero(core.team != team)
        self._turns = [int(boat) for pair in zip(self._own, others, strict=True) for boat in pair]
        self._every = max(round(MOVE_S / core.config.decision_s), 1)
        games = core.n_games
        self._plans = np.full((games, core.n_boats, self._horizon), STOP, dtype=np.int64)
        self._age = np.zeros(games, np.int64)
        self._rngs: dict[int, np.random.Generator] = {}
        self._mine = np.ones(games, np.bool_)
        self._out = np.zeros((games, self._own.size, 2))
        self.think_times_s = []
        self.restart(self._mine, seed)

    def plays(self, games: BoolArray) -> None:
        """Only these games (B,) are searched in from now on."""
        self._mine = games

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew, game b with seed + b; the others go on."""
        self._plans[chosen], self._age[chosen] = STOP, 0
        for game in np.flatnonzero(chosen):
            self._rngs[int(game)] = np.random.default_rng([(int(seed) + int(game)) & 0x7FFFFFFF, 0x10CA5])

    def act(self, core: BatchedMctf, team: int) -> Array:
        """Commands (B, n_team, 2), speed m/s and relative heading deg; the array is reused by the next call.

        Raises:
            PolicyError: `reset` was not called for this team and number of games.
        """
        if team != self._team or core.n_games != self._mine.size:
            raise PolicyError(f"policy {self.name!r} was not reset for team {team} of these games; call reset first")
        for game in np.flatnonzero(self._mine & (self._age % self._every == 0)):
            self._think(core, int(game))
        self._age[self._mine] += 1
        follow_plans(core.rules, core.games, self._plans, self._own, self._out)
        return self._out

    def _think(self, core: BatchedMctf, game: int) -> None:
        """A macro-action is over: drop it from every plan, repeat the last (the shift buffer), and search."""
        begun, plans, move = time.perf_counter(), self._plans[game], int(self._age[game]) // self._every
        if move:
            plans[:, :-1] = plans[:, 1:].copy()
        boats = self._turns if move == 0 else [self._turns[move % len(self._turns)]]
        for boat in boats:
            home = home_of(core, int(core.team[boat]), boat, game)
            hints = hints_for(core, boat, home, game)
            evolve(self._rules, core.games, game, plans, boat, hints, home, self._rngs[game], self._desk)
        self.think_times_s.append((time.perf_counter() - begun) / len(boats))


def _forward_model(config: GameConfig) -> GameConfig:
    """The rules that are searched in; decisions of several steps are played as they are, their headings held."""
    return config.replace(dt_s=config.dt_s if config.decision_steps > 1 else max(STEP_S, config.dt_s))
