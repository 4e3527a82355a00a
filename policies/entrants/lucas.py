"""Lucas-QMU: rolling-horizon evolution for many boats.

From the paper: sequences of macro-actions are evolved in a forward model (rolling-horizon evolution: Gaina, Devlin,
Lucas and Perez-Liebana 2020, arXiv 2003.12331). Each search is for one boat; own and opposing players alternate
(co-evolution: Liu, Perez-Liebana and Lucas 2016, arXiv 1607.01730), with a shift buffer. Rules made for the score
refine the plan.

Our additions: the forward model is the batched simulator itself. Macro-actions are eight headings at full speed and a
stop, held for `MOVE_S`. Mutation, fitness weights and the rules are ours. The fitness counts captures, grabs, tags,
progress, boats out of bounds, and contacts with teammates and opponents.
"""

from __future__ import annotations

import math
import time

import numpy as np
from steerclear.env.arrays import make_rules
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_geometry
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L

from ..evolution import HEADINGS, STOP, evolve, follow_plans, make_scratch
from .catalogue import entrant
from .observation import docks_of
from .play import BatchFront

MOVE_S = 1.2
HORIZON = 15
POPULATION, GENERATIONS = 15, 4
STEP_S = 0.2
"""Step of the forward model: twice the game's, which costs a tenth of a metre over a plan and halves the time.
Decisions of several steps are simulated unchanged, with headings held.
"""


class LucasBatch:
    """A `BatchPolicy` that searches with the simulator, game after game: at every macro-action for one boat.

    Args:
        population: plans of a generation.
        generations: times the best plan is mutated in a search.
        horizon: macro-actions of a plan.

    Attributes:
        think_times_s: times of the searches for one boat so far.

    Raises:
        PolicyError: a value is not a whole number, or below 2, 1 and 1.
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
        rules = core.config
        model = rules.replace(dt_s=rules.dt_s if rules.decision_steps > 1 else max(STEP_S, rules.dt_s))
        self._rules = make_rules(model, field_geometry(model))
        self._scratch = make_scratch(model, self._population, self._generations, self._horizon, MOVE_S)
        self._team, self._own = team, np.flatnonzero(core.team == team)
        others = np.flatnonzero(core.team != team)
        self._turns = [int(boat) for pair in zip(self._own, others, strict=True) for boat in pair]
        self._every = max(round(MOVE_S / rules.decision_s), 1)
        games = core.n_games
        self._plans = np.full((games, core.n_boats, self._horizon), STOP, dtype=np.int64)
        self._age = np.zeros(games, np.int64)
        self._rngs: dict[int, np.random.Generator] = {}
        self._mine = np.ones(games, np.bool_)
        self._out = np.zeros((games, self._own.size, 2))
        self.think_times_s = []
        self.restart(self._mine, seed)

    def plays(self, games: BoolArray) -> None:
        """Search only in these games (B,) from now on."""
        self._mine = games

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew, game b with seed + b; the others go on."""
        self._plans[chosen], self._age[chosen] = STOP, 0
        for game in np.flatnonzero(chosen):
            self._rngs[int(game)] = np.random.default_rng([(int(seed) + int(game)) & 0x7FFFFFFF, 0x10CA5])

    def act(self, core: BatchedMctf, team: int) -> Array:
        """Return commands (B, n_team, 2), speed m/s and relative heading deg; the next call reuses the array."""
        if team != self._team or core.n_games != self._mine.size:
            raise PolicyError(f"policy {self.name!r} was not reset for team {team} of these games; call reset first")
        for game in np.flatnonzero(self._mine & (self._age % self._every == 0)):
            self._think(core, int(game))
        self._age[self._mine] += 1
        follow_plans(core.rules, core.games, self._plans, self._own, self._out)
        return self._out

    def _think(self, core: BatchedMctf, game: int) -> None:
        """Search at the end of a macro-action: drop it from every plan, repeat the last one (shift buffer), evolve."""
        begun, plans, move = time.perf_counter(), self._plans[game], int(self._age[game]) // self._every
        if move:
            plans[:, :-1] = plans[:, 1:].copy()
        boats = self._turns if move == 0 else [self._turns[move % len(self._turns)]]
        for boat in boats:
            home = home_of(core, int(core.team[boat]), boat, game)
            hints = hints_for(core, boat, home, game)
            evolve(self._rules, core.games, game, plans, boat, hints, home, self._rngs[game], self._scratch)
        self.think_times_s.append((time.perf_counter() - begun) / len(boats))


def home_of(core: BatchedMctf, team: int, boat: int, game: int = 0) -> Array:
    """Return where a boat brings the flag, m: the nearest dock, otherwise the base."""
    docks = np.array(docks_of(core, team)).reshape(-1, 2)
    if not len(docks):
        return np.asarray(core.flag_home[team])
    place = core.state[game, boat, [L.X, L.Y]]
    return np.asarray(docks[int(np.linalg.norm(docks - place, axis=1).argmin())])


def hints_for(core: BatchedMctf, boat: int, home: Array, game: int = 0) -> IntArray:
    """Return macro-actions to try first: straight to the other flag, straight home, and a stop."""
    place, goal = core.state[game, boat, :2], core.flag_position[game, 1 - int(core.team[boat])]
    headings = [math.degrees(math.atan2(aim[0] - place[0], aim[1] - place[1])) for aim in (goal, home)]
    return np.array([*(round(heading / 45.0) % HEADINGS for heading in headings), STOP], dtype=np.int64)


@entrant(
    "lucas",
    "rolling-horizon evolution of macro-actions in the simulator, boat by boat (Lucas-QMU)",
    "Lucas-QMU",
    batch=LucasBatch,
)
class Lucas(BatchFront):
    """Searches with the simulator: a thin layer over `LucasBatch` with the same arguments."""

    name = "lucas"

    def __init__(self, population: int = POPULATION, generations: int = GENERATIONS, horizon: int = HORIZON) -> None:
        super().__init__()
        self._batch = LucasBatch(population, generations, horizon)

    @property
    def think_times_s(self) -> list[float]:
        """Times of the searches for one boat so far."""
        return self._batch.think_times_s
