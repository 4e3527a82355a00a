"""`MctfVecEnv`: a Stable-Baselines3 vector environment over thousands of games (extra ``[train]``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from ..exceptions import ConfigError
from .team_batch import Stepped, TeamBatch
from .vector_gym import spaces_of


class MctfVecEnv(VecEnv):
    """SB3 vector environment in which every boat of one team in every game is one sub-environment.

    One policy learns to play them all. An info holds the learner's events, by name of `tallies.EVENTS`. Where its game
    ended, ``episode`` holds the game's totals, which SB3's own statistics read.

    Args:
        batch: the games, see `TeamBatch`.
    """

    def __init__(self, batch: TeamBatch) -> None:
        self.batch = batch
        self._actions: Any = None
        self.render_mode = None
        super().__init__(batch.learners, *spaces_of(batch))

    def reset(self) -> Any:
        """Start all games and return observations (L, n_obs).

        Raises:
            ConfigError: options were set; these games have none.
        """
        seed = next((seed for seed in self._seeds if seed is not None), None)
        given = sorted({str(name) for options in self._options for name in options})
        self._reset_seeds()
        self._reset_options()
        if given:
            raise ConfigError(f"unknown reset options {', '.join(given)}; how games start is in their GameConfig")
        return self.batch.reset(seed)

    def step_async(self, actions: Any) -> None:
        """Store the learners' actions."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Step all games. Ended ones start anew, with their last observation in the info."""
        out = self.batch.step(self._actions)
        done = out.terminated | out.truncated
        return out.observations, out.rewards.astype(np.float32), done, self._infos(out, done)

    def _infos(self, out: Stepped, done: Any) -> list[dict[str, Any]]:
        """Return the infos. They hold non-zero counts only, because most learners have no events in most steps."""
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for name, counts in out.events.items():
            for i in np.flatnonzero(counts):
                infos[i][name] = float(counts[i])
        for i in np.flatnonzero(done):
            infos[i] |= {
                "terminal_observation": out.final_observations[i],
                "TimeLimit.truncated": bool(out.truncated[i] and not out.terminated[i]),
                "episode": {name: float(totals[i]) for name, totals in out.episodes.items()},
            }
        return infos

    def action_masks(self) -> Any:
        """Return actions (L, 17) that the shield would pass; MaskablePPO of sb3-contrib uses them. See `TeamBatch`."""
        return self.batch.action_masks()

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return the attribute once per chosen sub-environment; all of them share one object."""
        return [getattr(self, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the shared object."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the batch and return its answer once per chosen sub-environment; each has its own mask."""
        if method_name == "action_masks":
            return list(self.action_masks()[self._chosen(indices)])
        answer = getattr(self.batch, method_name)(*args, **kwargs)
        return [answer] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each: no sub-environment has a wrapper of its own."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
