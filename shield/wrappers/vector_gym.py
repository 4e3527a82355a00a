"""`MctfVectorEnv`: a Gymnasium vector environment over thousands of games, with the shield inside."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ..exceptions import ConfigError
from .team_batch import TeamBatch


def spaces_of(batch: TeamBatch) -> tuple[Space[Any], Space[Any]]:
    """Return observation and action space of one learner."""
    observation = Box(-1.0, 1.0, (batch.core.n_obs,), np.float32)
    if batch.actions == "discrete":
        return observation, Discrete(17)
    if batch.actions == "normalised":
        return observation, Box(-1.0, 1.0, (2,), np.float32)
    high = np.array([batch.top_speed_mps, 180.0], np.float32)
    return observation, Box(np.array([0.0, -180.0], np.float32), high, dtype=np.float32)


class MctfVectorEnv(VectorEnv[Any, Any, Any]):
    """Gymnasium vector environment in which every boat of one team in every game is one sub-environment.

    Games that end start anew in the same step. Infos of a step hold the events by name of `tallies.EVENTS`, each
    (num_envs,). Where games ended, infos also hold ``final_obs`` and ``totals``: reward ``r``, decisions ``l``, seconds
    ``t`` and the game's counts, with the mask ``_totals``. The key ``episode`` is left to Gymnasium's own wrappers.

    Args:
        batch: the games, see `TeamBatch`.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(self, batch: TeamBatch) -> None:
        self.batch = batch
        self.num_envs = batch.learners
        self.single_observation_space, self.single_action_space = spaces_of(batch)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start all games. Game b draws the same random numbers for a seed, whatever the number of games.

        Raises:
            ConfigError: options were given, or a list of seeds.
        """
        if options:
            raise ConfigError(f"unknown reset options {', '.join(options)}; how games start is in their GameConfig")
        return self.batch.reset(seed), {}

    def action_masks(self) -> Any:
        """Return actions (num_envs, 17) that the shield would pass in the next step, see `TeamBatch.action_masks`."""
        return self.batch.action_masks()

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all games."""
        out = self.batch.step(actions)
        ended = out.terminated | out.truncated
        infos: dict[str, Any] = dict(out.events)
        if ended.any():
            infos |= {"totals": dict(out.episodes), "_totals": ended}
            infos |= {"final_obs": out.final_observations, "_final_obs": ended}
        return out.observations, out.rewards, out.terminated, out.truncated, infos
