"""One team's boats in many games as a flat batch of learners; both vector environments use it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import NoNumbersError, numbers
from ..batch import BatchedShield
from ..exceptions import ConfigError, GameError, PolicyError
from ..jit import Array, BoolArray
from ..platforms import layout as L
from .actions import DISCRETE, Seat, read_flat
from .checks import team_number
from .games_shield import check_games
from .tallies import Tallies, changed_by

ACTIONS = ("discrete", "continuous", "normalised")
MOST_INTERVAL = 1000
"""Most game steps for which a decision may be held."""


class Stepped(NamedTuple):
    """Outcome of a step for the L = games * boats learners."""

    observations: NDArray[np.float32]  # (L, n_obs) float32, of the new game where one ended
    rewards: Array  # (L,)
    terminated: BoolArray  # (L,) the game was won
    truncated: BoolArray  # (L,) its time was over
    final_observations: NDArray[np.float32]  # (L, n_obs) before a new game began; only rows of ended games matter
    events: Mapping[str, Array] = {}  # events of the decision, by name of `tallies.EVENTS`, each (L,)
    # totals of the current games, ended ones included, each (L,): ``r`` reward, ``l`` decisions, ``t`` s since the
    # batch was made, and the names of `tallies.EVENTS`
    episodes: Mapping[str, Array] = {}


class TeamBatch:
    """The boats of one team in B games of a `BatchedMctf` as learners. A batch policy plays the other team.

    Args:
        core: the `BatchedMctf`.
        opponent: batch policy (`steerclear.policies.make_batch`) of the other team; None: its boats hold still.
        team: "blue" or "red", the learners' side.
        shield: shield for the learners' team, or None.
        actions: "discrete" (17 numbers), "continuous" (speed m/s, relative heading deg) or "normalised" (the same, each
            scaled to [-1, 1]: stop to top speed, -180 to 180 deg).
        seed: seed of games and opponent.
        interval: game steps for which a decision is held, as a steered course; the shield filters each step.
        reward: replaces the game's own reward: an object with ``begin(batch, games)`` for games (B,) that begin anew,
            and ``reward(batch, changed)`` for every game step, which returns (B, n).

    Raises:
        ConfigError: unknown team or kind of actions, an opponent for single games, or a shield that was not built for
            these games.
    """

    def __init__(
        self,
        core: Any,
        opponent: Any = None,
        team: str | int = "blue",
        shield: BatchedShield | None = None,
        actions: str = "discrete",
        seed: int = 0,
        interval: int = 1,
        reward: Any = None,
    ) -> None:
        if opponent is not None and not callable(getattr(opponent, "restart", None)):
            raise ConfigError(
                f"{type(opponent).__name__} plays one game, not a batch; give steerclear.policies.make_batch(name)"
            )
        if actions not in ACTIONS:
            raise ConfigError(f"unknown actions {actions!r}; choose one of {', '.join(ACTIONS)}")
        if type(interval) is not int or not 1 <= interval <= MOST_INTERVAL:
            raise ConfigError(f"interval is {interval!r}; give a whole number of game steps, 1 to {MOST_INTERVAL}")
        self.core, self.opponent, self.shield = core, opponent, shield
        self.interval, self.reward = interval, reward
        self.team = team_number(team)
        self.actions = actions
        self.boats = np.flatnonzero(core.team == self.team)
        self.others = np.flatnonzero(core.team != self.team)
        self.learners = core.n_games * len(self.boats)
        if shield is not None and not isinstance(shield, BatchedShield):
            raise ConfigError(f"{type(shield).__name__} is no shield of a batch of games; give games_shield(core)")
        if shield is not None:
            check_games(shield, core)
        self._filter: Any = None if shield is None else shield.filter_for(self.team)
        self._games_filter = self._filter  # the shield's own filter; training may replace self._filter
        self._commands = np.zeros((core.n_games, core.n_boats, 2))
        self._seed = seed
        self._born_s = time.perf_counter()
        self.tallies = Tallies(core, self.team, self.boats)

    @property
    def top_speed_mps(self) -> float:
        """Highest top speed of the learners' boats, m/s."""
        return float(np.max(self.core.max_speed_mps[self.boats]))

    def reset(self, seed: int | None = None) -> NDArray[np.float32]:
        """Start all games and return observations (L, n_obs).

        Args:
            seed: seed of games and opponent; None: the last one.

        Raises:
            ConfigError: the seed is not a whole number from 0.
        """
        if seed is not None and (isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0):
            raise ConfigError(f"seed is {seed!r}; give one whole number from 0 for all games, or None")
        self._seed = self._seed if seed is None else int(seed)
        observations = self.core.reset(seed=self._seed)
        if self.opponent is not None:
            self.opponent.reset(self.core, 1 - self.team, self._seed)
        if self.shield is not None:
            self.shield.reset()
        self._begin_counts(np.ones(self.core.n_games, np.bool_))
        return self._flat(observations)

    def step(self, actions: Any) -> Stepped:
        """Play one decision of all learners, held for `interval` game steps. Games that end in it start anew.

        Raises:
            PolicyError: the actions have the wrong shape, are out of range or not finite.
        """
        own = self._decode(actions)
        n_games, n_boats = self.core.n_games, len(self.boats)
        going, rewards = np.ones(n_games, np.bool_), np.zeros((n_games, n_boats))
        terminated, truncated = np.zeros(n_games, np.bool_), np.zeros(n_games, np.bool_)
        course_deg = self._heading_deg() + own[..., 1]
        final: Any = None
        self.tallies.begin_decision()
        for moved in range(self.interval):
            if moved:
                own[..., 1] = (course_deg - self._heading_deg() + 180.0) % 360.0 - 180.0
            observations, earned = self._move(own, going)
            rewards += earned * going[:, None]
            ended = (self.core.terminated | self.core.truncated) & going
            terminated |= self.core.terminated & going
            truncated |= self.core.truncated & going
            now = self._flat(observations)
            final = now if final is None else np.where(self._spread(going)[:, None], now, final)
            going = going & ~ended
            if not going.any():
                break
        ended = terminated | truncated
        self.tallies.end_decision(rewards)
        episodes = self.tallies.flat_totals()
        episodes["t"] = np.full(self.learners, time.perf_counter() - self._born_s)
        if ended.any() and hasattr(self.opponent, "ended"):
            self.opponent.ended(self.core, ended)
        outcome = (self._spread(terminated), self._spread(truncated))
        seen = self._begin_anew(ended, final)
        return Stepped(seen, rewards.reshape(-1), *outcome, final, self.tallies.flat_step(), episodes)

    def action_masks(self) -> BoolArray:
        """Return which discrete actions (L, 17) the shield would pass unchanged in the next game step.

        Each is judged on the assumption that teammates go straight on. All pass without a shield, and for a boat of
        which none would pass: there the shield decides.

        Raises:
            ConfigError: actions are not discrete.
        """
        if self.actions != "discrete":
            raise ConfigError(f"actions are {self.actions}, and masks are of numbers; give actions='discrete'")
        core, boats = self.core, self.boats
        if self._games_filter is None:
            return np.ones((self.learners, len(DISCRETE)), np.bool_)
        wanted = np.zeros((core.n_games, core.n_boats, len(DISCRETE), 2))
        wanted[:, boats] = DISCRETE
        wanted[..., 0] *= core.max_speed_mps[:, None]
        passes = self._games_filter.safe_actions(core, wanted)[:, boats].reshape(self.learners, -1)
        passes[~passes.any(axis=1)] = True
        return passes

    def _move(self, own: Array, going: BoolArray) -> tuple[Any, Array]:
        """Play one game step and return observations of all games and the learners' rewards (B, n)."""
        self._commands[:, self.boats] = own
        if self.opponent is not None:
            self._commands[:, self.others] = self.opponent.act(self.core, 1 - self.team)
        observations, rewards, _, _ = self.core.step(self._commands, self._filter)
        changed = changed_by(self.shield, self.boats, (self.core.n_games, len(self.boats)))
        self.tallies.count(going, changed)
        if self.reward is not None:
            return observations, self.reward.reward(self, changed)
        return observations, rewards[:, self.boats]

    def _heading_deg(self) -> Array:
        """Return headings (B, n) of the learners' boats, deg."""
        return np.array(self.core.state[:, self.boats, L.HEADING])

    def _begin_counts(self, games: BoolArray) -> None:
        """Reset the counts of games (B,) that begin anew."""
        self.tallies.forget(games)
        if self.reward is not None:
            self.reward.begin(self, games)

    def restart(self, games: BoolArray) -> NDArray[np.float32]:
        """Start the chosen games (B,) anew and return observations of all. Each game's random numbers continue."""
        return self._begin_anew(games, self._flat(self.core.observations))

    def _begin_anew(self, ended: BoolArray, final: NDArray[np.float32]) -> NDArray[np.float32]:
        """Start the games in ``ended`` (B,) anew."""
        if not ended.any():
            return final
        observations = self.core.reset(mask=ended)
        if self.opponent is not None:
            self._seed += self.core.n_games
            self.opponent.restart(ended, self._seed)
        if self.shield is not None:
            self.shield.reset(ended)
        self._begin_counts(ended)
        seen = final.copy()
        anew = self._spread(ended)
        seen[anew] = self._flat(observations)[anew]
        return seen

    def _decode(self, actions: Any) -> Array:
        """Return commands (B, boats, 2) of flat actions."""
        pairs = self.actions != "discrete"
        top_mps = np.tile(self.core.max_speed_mps[self.boats], self.core.n_games)
        if self.actions == "normalised":
            actions = _in_units(actions, top_mps)
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


def _in_units(actions: Any, top_mps: Array) -> Any:
    """Return speed m/s and relative heading deg of actions, clipped to [-1, 1]; invalid ones are returned unchanged."""
    try:
        given = numbers(actions)
    except NoNumbersError:
        return actions
    if given.shape != (len(top_mps), 2):
        return given
    clipped = np.clip(given, -1.0, 1.0)
    return np.stack([0.5 * (clipped[:, 0] + 1.0) * top_mps, 180.0 * clipped[:, 1]], axis=1)
