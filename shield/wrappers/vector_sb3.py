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
    """Every boat of one team in every game is one sub-environment of SB3; one policy learns to play them all.

    An info holds the events of `tallies.EVENTS` that happened to the learner, and where its game ended ``episode``,
    which SB3's own statistics read, with the game's totals.

    Args:
        batch: the games, see `TeamBatch`.
    """

    def __init__(self, batch: TeamBatch) -> None:
        self.batch = batch
        self._actions: Any = None
        self.render_mode = None
        super().__init__(batch.learners, *spaces_of(batch))

    def reset(self) -> Any:
        """Start all games; observations (L, n_obs).

        Raises:
            ConfigError: options were set, of which these games have none.
        """
        seed = next((seed for seed in self._seeds if seed is not None), None)
        given = sorted({str(name) for options in self._options for name in options})
        self._reset_seeds()
        self._reset_options()
        if given:
            raise ConfigError(f"unknown reset options {', '.join(given)}; how games start is in their GameConfig")
        return self.batch.reset(seed)

    def step_async(self, actions: Any) -> None:
        """Take the learners' actions."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Step all games; ended ones start anew, with their last observation in the info."""
        out = self.batch.step(self._actions)
        done = out.terminated | out.truncated
        return out.observations, out.rewards.astype(np.float32), done, self._infos(out, done)

    def _infos(self, out: Stepped, done: Any) -> list[dict[str, Any]]:
        """What happened, only where something did: most learners of most steps have nothing to tell."""
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
        """(L, 17) actions the shield would let pass, as sb3-contrib's MaskablePPO asks for them; see `TeamBatch`."""
        return self.batch.action_masks()

    def close(self) -> None:
        """Nothing to give back."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute, once per sub-environment asked for; all of them share one object."""
        return [getattr(self, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the shared object."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the batch, with one answer per sub-environment asked for; of masks each has its own."""
        if method_name == "action_masks":
            return list(self.action_masks()[self._chosen(indices)])
        answer = getattr(self.batch, method_name)(*args, **kwargs)
        return [answer] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No sub-environment has a wrapper of its own."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
