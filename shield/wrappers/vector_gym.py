"""`MctfVectorEnv`: a Gymnasium vector environment over thousands of games, with the shield inside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ..exceptions import ConfigError
from .team_batch import TeamBatch


def spaces_of(batch: TeamBatch) -> tuple[Space[Any], Space[Any]]:
    """Observation and action space of one learner."""
    observation = Box(-1.0, 1.0, (batch.core.n_obs,), np.float32)
    if batch.actions == "discrete":
        return observation, Discrete(17)
    if batch.actions == "normalised":
        return observation, Box(-1.0, 1.0, (2,), np.float32)
    high = np.array([batch.top_speed_mps, 180.0], np.float32)
    return observation, Box(np.array([0.0, -180.0], np.float32), high, dtype=np.float32)


def mask_of(options: Mapping[str, Any] | None) -> Any:
    """The ``reset_mask`` among reset's options, or None; a `ConfigError` where there are others."""
    for name in options or {}:
        if name != "reset_mask":
            raise ConfigError(
                f"unknown reset option {name!r}; known: reset_mask. How games start is in their GameConfig"
            )
    return (options or {}).get("reset_mask")


class MctfVectorEnv(VectorEnv[Any, Any, Any]):
    """Every boat of one team in every game is one sub-environment.

    Infos of a step hold what happened, by name of `tallies.EVENTS`, each (num_envs,), and where games ended
    ``final_obs`` (in the same-step mode) and ``totals``: reward ``r``, decisions ``l``, seconds ``t`` and the game's
    totals, each with its mask ``_totals``; ``episode`` is left to Gymnasium's own wrappers.

    Args:
        batch: the games, see `TeamBatch`.
        autoreset_mode: when an ended game starts anew: in the same step, in the next one (whose actions are not
            looked at), or never (reset with a ``reset_mask``).

    Raises:
        ConfigError: no such mode.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(self, batch: TeamBatch, autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP) -> None:
        try:
            self._mode = AutoresetMode(autoreset_mode)
        except ValueError:
            known = ", ".join(mode.value for mode in AutoresetMode)
            raise ConfigError(f"unknown autoreset_mode {autoreset_mode!r}; choose one of {known}") from None
        self.metadata = {**self.metadata, "autoreset_mode": self._mode}
        self.batch = batch
        self.num_envs = batch.learners
        self.single_observation_space, self.single_action_space = spaces_of(batch)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._ended = np.zeros(batch.core.n_games, np.bool_)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start all games, or those of some sub-environments.

        Args:
            seed: one seed for all games; game b draws the same numbers however many there are.
            options: {"reset_mask": (num_envs,) bool} starts only those games, all boats of a game alike; the others go
                on, and their observations are those of the last step.

        Raises:
            ConfigError: another option, a mask that is none, or a list of seeds.
        """
        mask = mask_of(options)
        observations = self.batch.reset(seed, mask)
        started = np.ones(self.num_envs, np.bool_) if mask is None else np.asarray(mask)
        self._ended &= ~started.reshape(self._ended.size, -1)[:, 0]
        return observations, {}

    def action_masks(self) -> Any:
        """(num_envs, 17) actions the shield would let pass in the next game step, see `TeamBatch.action_masks`."""
        return self.batch.action_masks()

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all games.

        Raises:
            ConfigError: without autoreset, a game that has ended was not reset.
        """
        if self._mode is AutoresetMode.DISABLED and self._ended.any():
            raise ConfigError('games have ended; reset them with options={"reset_mask": terminated | truncated}')
        idle = self._ended.copy() if self._mode is AutoresetMode.NEXT_STEP else None
        same = self._mode is AutoresetMode.SAME_STEP
        out = self.batch.step(actions, autoreset=same, idle=idle)
        ended = out.terminated | out.truncated
        self._ended = ended.reshape(self._ended.size, -1)[:, 0] & (not same)
        infos: dict[str, Any] = dict(out.events)
        if ended.any():
            infos |= {"totals": dict(out.episodes), "_totals": ended}
            if same:
                infos |= {"final_obs": out.final_observations, "_final_obs": ended}
        return out.observations, out.rewards, out.terminated, out.truncated, infos
