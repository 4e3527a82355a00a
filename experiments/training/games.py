"""The games of a training: core, opponents, shield, rewards, as one vector environment."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from steerclear.env.core import BatchedMctf
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.game_facts import facts_of_games
from steerclear.shield.shared import share
from steerclear.shield.wrappers import MctfVecEnv, TeamBatch, games_shield

from .rewards import WeightedSum
from .seldom_asked import SeldomAsked
from .settings import Stage, TrainingSettings


def core_of(settings: TrainingSettings, games: int, seed: int, stage: Stage | None = None) -> BatchedMctf:
    """So many games by a config's rules, a stage's or those of evaluations, starts drawn from the seed.

    Raises:
        ConfigError: the rules cannot be.
    """
    return BatchedMctf(settings.game(stage), n_games=games, seed=seed)


def shield_of(settings: TrainingSettings, core: BatchedMctf, team: str = "blue") -> Any:
    """The shield of a config for some games."""
    config = ShieldConfig.of(**{**facts_of_games(core).settings(), **settings.shield_settings})
    return games_shield(core, config, team=team)


def learners_of(settings: TrainingSettings, opponent: Any, stage: Stage | None = None) -> TeamBatch:
    """The learners, blue, in games of a stage, the first where none is named, against an opponent.

    A shield that only evaluations ask is built here, too: what is wrong with it is found before the first rollout.
    """
    stage = settings.stages[0] if stage is None else stage
    core = core_of(settings, settings.games, settings.seed, stage)
    shield = shield_of(settings, core) if settings.shield != "none" else None
    batch = TeamBatch(
        core,
        opponent,
        "blue",
        shield=shield if settings.shielded_training else None,
        actions=settings.actions,
        seed=settings.seed,
        interval=settings.interval,
        reward=WeightedSum(settings.reward_weights(stage)),
    )
    if settings.shielded_training and settings.shield_every > 1:
        SeldomAsked(batch, settings.shield_every)
    return batch


def set_stage(batch: TeamBatch, settings: TrainingSettings, stage: Stage, guard: tuple[Any, Any]) -> None:
    """Play as a stage says from now on: how often tags succeed, what earns how much, the shield or none.

    Args:
        batch: the games.
        settings: of the training.
        stage: what is to be.
        guard: shield and command filter of the stages that have one.
    """
    set_tags(batch.core, stage)
    batch.shield, batch._filter = guard if stage.shielded else (None, None)
    batch.reward = WeightedSum(settings.reward_weights(stage))
    batch.reward.begin(batch, np.ones(batch.core.n_games, np.bool_))


def set_tags(core: BatchedMctf, stage: Stage) -> None:
    """Let tags succeed as often as a stage says."""
    wanted = core.config.tag_probability if stage.tag_probability is None else stage.tag_probability
    core.rules = share(core.rules._replace(tag_probability=float(wanted)))


def check_sight(settings: TrainingSettings) -> None:
    """Refuse stages by whose rules boats see other numbers than in evaluations.

    Raises:
        ConfigError: there is one.
    """
    wanted = core_of(settings, 1, 0).observation_high
    for stage in settings.stages:
        if stage.rules and not np.array_equal(core_of(settings, 1, 0, stage).observation_high, wanted):
            raise ConfigError(
                f"rules {dict(stage.rules)!r} of a stage change what boats see or its bounds (field, teams, obstacles, "
                "top speed of the fastest boat, scores, cool-down); leave those as in the training's rules"
            )


def stagger(batch: TeamBatch, seed: int) -> None:
    """Put the first games' clocks forward by random times, so that games do not all end in the same step."""
    core = batch.core
    longest_s = core.config.max_time_s
    decision_s = core.config.decision_s * batch.interval
    steps = np.random.default_rng([seed, 5]).integers(0, max(1, int(0.9 * longest_s / decision_s)), core.n_games)
    core.time_s[:] = steps * decision_s


class Timed:
    """A function that counts the time spent in it.

    Attributes:
        spent_s: since `taken` was last called, s.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self.spent_s = function, 0.0

    def __call__(self, *args: Any) -> Any:
        """Call it."""
        began = time.perf_counter()
        try:
            return self._function(*args)
        finally:
            self.spent_s += time.perf_counter() - began

    def taken(self) -> float:
        """Time spent, s; counts anew."""
        spent_s, self.spent_s = self.spent_s, 0.0
        return spent_s


class PlacedVecEnv(MctfVecEnv):
    """Learners whose observations end in their place in the team, one-hot: for a network per role."""

    def __init__(self, batch: TeamBatch) -> None:
        super().__init__(batch)
        size = len(batch.boats)
        self._places = np.tile(np.eye(size, dtype=np.float32), (batch.core.n_games, 1))
        self.observation_space = Box(-1.0, 1.0, (batch.core.n_obs + size,), np.float32)

    def reset(self) -> Any:
        """As `MctfVecEnv.reset`."""
        return self._placed(super().reset())

    def step_wait(self) -> Any:
        """As `MctfVecEnv.step_wait`."""
        observations, rewards, done, infos = super().step_wait()
        for i in np.flatnonzero(done):
            last = infos[i]["terminal_observation"]
            infos[i]["terminal_observation"] = np.concatenate([last, self._places[i]])
        return self._placed(observations), rewards, done, infos

    def _placed(self, observations: Any) -> Any:
        return np.concatenate([observations, self._places], axis=1)
