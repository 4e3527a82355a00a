"""`EachGame`: a policy for single games in some games of a batch, one after another; slow, and so for small shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.env.observe import observe_games  # noqa: F401 (its kernel fills the twin's observations)
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L

from ..entries.team import make_team


class EachGame:
    """A `BatchPolicy` round a policy for single games: each game has a policy and a twin of the game of its own.

    Args:
        name: of the policy, as `steerclear.policies.make` takes it.
        every: game steps between two questions to it. The policy is told that a step is so long, and what it answers is
            held as a course steered: cheaper, and a coarser player of the same kind.
    """

    def __init__(self, name: str, every: int = 1) -> None:
        policies.check(name)
        self.name, self.every = name, every
        self._teams: dict[int, Any] = {}

    def reset(self, core: Any, team: int, seed: int) -> None:
        """Begin all games."""
        self._team = team
        self._own = np.flatnonzero(core.team == team)
        self._seeds = {game: seed + game for game in range(core.n_games)}
        self._twins: dict[int, Any] = {}
        self._out = np.zeros((core.n_games, self._own.size, 2))
        self._mine = np.ones(core.n_games, np.bool_)
        self._left = np.zeros(core.n_games, np.int64)
        self._course_deg = np.zeros((core.n_games, self._own.size))

    def plays(self, games: BoolArray) -> None:
        """Only these games (B,) are played from now on."""
        self._mine = games

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew."""
        for game in np.flatnonzero(chosen):
            self._seeds[int(game)] = seed + int(game)
            self._twins.pop(int(game), None)
        self._left[chosen] = 0

    def act(self, core: Any, team: int) -> Array:
        """Commands (B, n_team, 2); the array is reused by the next call."""
        heading_deg = core.state[:, self._own, L.HEADING]
        self._out[..., 1] = (self._course_deg - heading_deg + 180.0) % 360.0 - 180.0
        for game in np.flatnonzero(self._mine & (self._left == 0)):
            self._out[game] = self._ask(core, int(game))
            self._course_deg[game] = heading_deg[game] + self._out[game, :, 1]
            self._left[game] = self.every
        self._left[self._mine] -= 1
        return self._out

    def _seen_as(self, config: GameConfig) -> GameConfig:
        """The rules with steps as long as the time between two questions."""
        return config if self.every == 1 else config.replace(decision_steps=config.decision_steps * self.every)

    def _ask(self, core: Any, game: int) -> Array:
        fresh = game not in self._twins
        if fresh:
            self._twins[game] = MctfEnv(self._seen_as(core.config), action_kind="continuous")
            self._twins[game].reset(seed=0)
        env = self._twins[game]
        env.core.restore(core.view(game))
        env.core.observe()
        ids = [core.config.agent_ids[i] for i in self._own]
        if fresh:
            self._teams.setdefault(game, make_team(self.name)).reset(env, ids, self._seeds[game])
        seen = {agent: env.core.observations[0, i].copy() for i, agent in enumerate(core.config.agent_ids)}
        actions = self._teams[game].act(seen, env.infos())
        return env.decode(actions)[self._own]
