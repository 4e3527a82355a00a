"""One team's boats in many games as a flat batch of learners: what both vector environments are made of."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..actions import Seat, read_flat
from ..batch import BatchedShield
from ..exceptions import ConfigError, GameError, PolicyError
from ..jit import Array, BoolArray
from .reading import team_number

ACTIONS = ("discrete", "continuous")


class Stepped(NamedTuple):
    """Outcome of a step for the L = games * boats learners.

    Attributes:
        observations: (L, n_obs) float32, of the new game where one ended.
        rewards: (L,).
        terminated: (L,) the game was won.
        truncated: (L,) its time was over.
        final_observations: (L, n_obs) before a new game began; only rows of ended games matter.
    """

    observations: NDArray[np.float32]
    rewards: Array
    terminated: BoolArray
    truncated: BoolArray
    final_observations: NDArray[np.float32]


class TeamBatch:
    """Learners are the boats of one team in B games of a `BatchedMctf`; the other team is played by a batch policy.

    Args:
        core: the `BatchedMctf`.
        opponent: batch policy (`steerclear.policies.make_batch`) of the other team; None: they hold still.
        team: "blue" or "red", the learners' side.
        shield: shield for the learners' team, or None.
        actions: "discrete" (17 numbers) or "continuous" (speed m/s, relative heading deg).
        seed: seed of games and opponent.

    Raises:
        ConfigError: unknown team or kind of actions, an opponent for single games, or a shield that is none of these
            games.
    """

    def __init__(
        self,
        core: Any,
        opponent: Any = None,
        team: str | int = "blue",
        shield: BatchedShield | None = None,
        actions: str = "discrete",
        seed: int = 0,
    ) -> None:
        if opponent is not None and not callable(getattr(opponent, "restart", None)):
            raise ConfigError(
                f"{type(opponent).__name__} plays one game, not a batch; give steerclear.policies.make_batch(name)"
            )
        if actions not in ACTIONS:
            raise ConfigError(f"unknown actions {actions!r}; choose one of {', '.join(ACTIONS)}")
        self.core, self.opponent, self.shield = core, opponent, shield
        self.team = team_number(team)
        self.actions = actions
        self.boats = np.flatnonzero(core.team == self.team)
        self.others = np.flatnonzero(core.team != self.team)
        self.learners = core.n_games * len(self.boats)
        self._filter = None if shield is None else _filter_of(shield, core, self.team)
        self._commands = np.zeros((core.n_games, core.n_boats, 2))
        self._seed = seed
        self._begun = False

    @property
    def top_speed_mps(self) -> float:
        """Highest top speed of the learners' boats, m/s."""
        return float(np.max(self.core.max_speed_mps[self.boats]))

    def reset(self, seed: int | None = None, learners: Any = None) -> NDArray[np.float32]:
        """Start games; returns observations (L, n_obs).

        Args:
            seed: seed of games and opponent; None: the last one for all games, else each goes on with its numbers.
            learners: (L,) bool, which learners' games to start, all boats of a game alike; None for all.

        Raises:
            ConfigError: no such choice of games, or no seed.
        """
        if seed is not None and (isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0):
            raise ConfigError(f"seed is {seed!r}; give one whole number from 0 for all games, or None")
        if learners is not None:
            if not self._begun:
                raise ConfigError("no game has begun; reset all games first, without a mask")
            return self._begin_anew(self._games_of(learners), self._flat(self.core.observations), seed)
        self._begun = True
        self._seed = self._seed if seed is None else int(seed)
        observations = self.core.reset(seed=self._seed)
        if self.opponent is not None:
            self.opponent.reset(self.core, 1 - self.team, self._seed)
        if self.shield is not None:
            self.shield.reset()
        return self._flat(observations)

    def step(self, actions: Any) -> Stepped:
        """Step all games; ended games start anew.

        Raises:
            PolicyError: the actions have the wrong shape, are out of range or not finite.
        """
        self._commands[:, self.boats] = self._decode(actions)
        if self.opponent is not None:
            self._commands[:, self.others] = self.opponent.act(self.core, 1 - self.team)
        observations, rewards, terminated, truncated = self.core.step(self._commands, self._filter)
        final = self._flat(observations)
        ended = terminated | truncated
        outcome = (self._spread(terminated), self._spread(truncated))
        flat_rewards = rewards[:, self.boats].reshape(-1).copy()
        return Stepped(self._begin_anew(ended.copy(), final), flat_rewards, *outcome, final)

    def _games_of(self, learners: Any) -> BoolArray:
        """(B,) bool, the games of learners (L,)."""
        chosen = np.asarray(learners)
        if chosen.shape != (self.learners,) or chosen.dtype != np.bool_:
            raise ConfigError(
                f"the mask is {chosen.dtype} of shape {chosen.shape}; give bool of shape ({self.learners},), one a boat"
            )
        by_game = chosen.reshape(self.core.n_games, -1)
        if not chosen.any() or (by_game.any(axis=1) != by_game.all(axis=1)).any():
            raise ConfigError("the mask must choose one game at least, and of each game all boats of the team or none")
        return np.array(by_game[:, 0])

    def _begin_anew(self, ended: BoolArray, final: NDArray[np.float32], seed: int | None = None) -> NDArray[np.float32]:
        """Start the games in ``ended`` (B,); with a seed from it, as `reset` starts all."""
        if not ended.any():
            return final
        observations = self.core.reset(mask=ended, seed=seed)
        if self.opponent is not None:
            self._seed += self.core.n_games
            self.opponent.restart(ended, self._seed if seed is None else int(seed))
        if self.shield is not None:
            self.shield.reset(ended)
        return self._flat(observations)

    def _decode(self, actions: Any) -> Array:
        """Commands (B, boats, 2) of flat actions."""
        pairs = self.actions == "continuous"
        top_mps = np.tile(self.core.max_speed_mps[self.boats], self.core.n_games)
        try:
            flat = read_flat(actions, top_mps, lambda i: Seat(f"learner {i}", float(top_mps[i]), pairs=pairs), pairs)
        except GameError as error:
            raise PolicyError(str(error)) from None
        return flat.reshape(self.core.n_games, len(self.boats), 2)

    def _flat(self, observations: Any) -> NDArray[np.float32]:
        flat: NDArray[np.float32] = observations[:, self.boats].reshape(self.learners, -1).copy()
        return flat

    def _spread(self, games: BoolArray) -> BoolArray:
        return np.repeat(games, len(self.boats))


def _filter_of(shield: Any, core: Any, team: int) -> Any:
    """The command filter of a shield of these games.

    Raises:
        ConfigError: it is no shield of a batch, or one of other games.
    """
    if not isinstance(shield, BatchedShield):
        raise ConfigError(f"{type(shield).__name__} is no shield of a batch of games; give games_shield(core)")
    shield.check_games(core)
    return shield.filter_for(team)
