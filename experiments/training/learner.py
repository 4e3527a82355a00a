"""SB3's PPO, driven one rollout at a time, with its state as plain arrays."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import CallbackList
from stable_baselines3.common.logger import Logger
from steerclear.policies.entrants.learned import read_weights
from steerclear.policies.entrants.learned.network import Network
from steerclear.shield.exceptions import ConfigError, SteerclearError
from steerclear.shield.wrappers import MctfVecEnv, TeamBatch
from torch import nn

from .games import PlacedVecEnv
from .networks import BoatPolicy, TeamFeatures, features_of, load_actor, network_of
from .settings import TrainingSettings
from .taking_over import ONE_OF_TWO, FirstPart, first_of, pair_of

ACTIVATIONS = {"tanh": nn.Tanh, "relu": nn.ReLU}


class DivergedError(SteerclearError):
    """The network's numbers are no longer finite."""


class Learner:
    """PPO over the games of a batch.

    Args:
        settings: of the training.
        batch: the games; they have begun.
        card: of exported networks.

    Raises:
        ConfigError: the device is not there, or the weights to begin with do not fit.
    """

    def __init__(self, settings: TrainingSettings, batch: TeamBatch, card: dict[str, Any]) -> None:
        self.settings, self.card = settings, card
        self.first = first_of(settings, batch.core)
        self._enter(batch)
        ppo = settings.ppo
        self.model = PPO(
            BoatPolicy,
            self.env,
            n_steps=ppo.steps,
            batch_size=min(ppo.batch, ppo.steps * batch.learners),
            n_epochs=ppo.epochs,
            learning_rate=ppo.learning_rate,
            gamma=ppo.discount,
            gae_lambda=ppo.gae_lambda,
            clip_range=ppo.clip,
            ent_coef=ppo.entropy,
            vf_coef=ppo.value,
            max_grad_norm=ppo.max_grad_norm,
            policy_kwargs=self._policy(batch),
            device=device_of(settings.device),
            seed=settings.seed,
        )
        self._written: dict[str, Any] = {}
        self.model.set_logger(Logger(None, []))
        self._callback = CallbackList([])
        self._callback.init_callback(self.model)
        self.model._last_episode_starts = np.ones(self.env.num_envs, bool)
        self.model.ep_success_buffer = deque(maxlen=1)
        if settings.start:
            self._begin_with(settings.start)
        self._learned = 0
        for name, parameter in self.model.policy.named_parameters():
            if "policy" in name or name.startswith(("action_net", "log_std")):
                parameter.register_hook(self._held_back)

    def _enter(self, batch: TeamBatch) -> None:
        self.core = batch.core
        if self.first is not None:
            batch.step = FirstPart(batch, self.first)
        self.env = MctfVecEnv(batch) if self.settings.net.roles == "shared" else PlacedVecEnv(batch)

    def play_in(self, batch: TeamBatch) -> None:
        """Go on in the games of another batch, as many as before; `begin` starts them."""
        self._enter(batch)
        self.model.set_env(self.env, force_reset=False)
        self.model._last_episode_starts[:] = True

    def _policy(self, batch: TeamBatch) -> dict[str, Any]:
        net = self.settings.net
        looks = {
            "features": features_of(batch.core, net.features),
            "n_obs": batch.core.n_obs,
            "interval": batch.interval,
            "places": len(batch.boats) if net.roles == "placed" else 0,
        }
        return {
            "net_arch": {"pi": list(net.hidden), "vf": list(net.hidden)},
            "activation_fn": ACTIVATIONS[net.activation],
            "features_extractor_class": TeamFeatures,
            "features_extractor_kwargs": looks,
            "roles": len(batch.boats) if net.roles == "each" else 1,
        }

    def _begin_with(self, path: str) -> None:
        network = read_weights(path)
        if network.carrying is not None:
            raise ConfigError(f"start {path} holds two networks, and one learns; {ONE_OF_TWO}")
        try:
            load_actor(self.model.policy, network)
        except ValueError as error:
            raise ConfigError(f"start {path} does not fit this network: {error}; give its own net settings") from None

    def _held_back(self, gradient: torch.Tensor) -> torch.Tensor:
        """The gradient of a parameter of the actor: nothing while the critic learns alone."""
        return torch.zeros_like(gradient) if self._learned < self.settings.ppo.critic_first else gradient

    def begin(self) -> None:
        """Start all games."""
        self.model._last_obs = self.env.reset()

    def rollout(self) -> list[dict[str, float]]:
        """Play a rollout; the games that ended in it."""
        model, ended = self.model, []
        model.ep_info_buffer = _Kept(ended)
        model.collect_rollouts(self.env, self._callback, model.rollout_buffer, n_rollout_steps=model.n_steps)
        return ended

    def learn(self) -> dict[str, float]:
        """Learn from the last rollout; what SB3 tells of it.

        Raises:
            DivergedError: a number of the network or loss is not finite.
        """
        self.model._update_current_progress_remaining(0, 1)
        try:
            self.model.train()
        except ValueError as error:  # torch's distributions refuse parameters that are not finite
            raise DivergedError(self._diverged()) from error
        self._learned += 1
        told = {name: float(value) for name, value in self.model.logger.name_to_value.items()}
        self.model.logger.name_to_value.clear()
        self.model.logger.name_to_count.clear()
        loss = told.get("train/loss", 0.0)
        if not np.isfinite(loss) or not all(bool(torch.isfinite(p).all()) for p in self.model.policy.parameters()):
            raise DivergedError(self._diverged())
        return {name.removeprefix("train/"): value for name, value in told.items()}

    @staticmethod
    def _diverged() -> str:
        return "the loss is no longer finite; lower ppo.learning_rate or the reward weights, earlier work is kept"

    def network(self) -> Network:
        """The actor as it is now, behind the network that plays until the flag is held, where there is one."""
        own = network_of(self.model.policy, self.settings.net.activation, self.card)
        return own if self.first is None else pair_of(self.first, own, self.core)

    def arrays(self) -> dict[str, np.ndarray]:
        """Network, optimiser, torch's random state, last observations."""
        found = {f"policy/{name}": value.detach().cpu().numpy() for name, value in self._values().items()}
        for k, state in self.model.policy.optimizer.state_dict()["state"].items():
            found |= {f"adam/{k}/{name}": torch.as_tensor(value).cpu().numpy() for name, value in state.items()}
        found["torch"] = torch.get_rng_state().numpy()
        found["counts"] = np.array([self.model._n_updates, self.model.num_timesteps, self._learned])
        found["last_obs"], found["starts"] = self.model._last_obs, self.model._last_episode_starts
        return {name: np.array(value) for name, value in found.items()}

    def put(self, arrays: dict[str, np.ndarray]) -> None:
        """Put back what `arrays` told.

        Raises:
            ConfigError: it is of another network.
        """
        values = self._values()
        for name, value in values.items():
            saved = arrays.get(f"policy/{name}")
            if saved is None or saved.shape != tuple(value.shape):
                raise ConfigError(
                    f"the checkpoint's network has another {name} (other observations, net or preset); "
                    "resume with the config it was made with"
                )
        self.model.policy.load_state_dict({name: torch.as_tensor(arrays[f"policy/{name}"]) for name in values})
        optimizer = self.model.policy.optimizer
        optimizer.load_state_dict({**optimizer.state_dict(), "state": self._moments(arrays)})
        torch.set_rng_state(torch.as_tensor(arrays["torch"]))
        self.model._n_updates, self.model.num_timesteps, self._learned = (int(count) for count in arrays["counts"])
        for key, name in (("last_obs", "_last_obs"), ("starts", "_last_episode_starts")):
            if arrays[key].shape != getattr(self.model, name).shape:
                raise ValueError(f"{key} has another shape")
            setattr(self.model, name, arrays[key])

    def _moments(self, arrays: dict[str, np.ndarray]) -> dict[int, dict[str, torch.Tensor]]:
        """The optimiser's state, by number of parameter.

        Raises:
            ValueError: it is not that of these parameters.
        """
        state: dict[int, dict[str, torch.Tensor]] = {}
        for name in (name for name in arrays if name.startswith("adam/")):
            _, k, key = name.split("/")
            state.setdefault(int(k), {})[key] = torch.as_tensor(arrays[name])
        sizes = [value.shape for value in self.model.policy.parameters()]
        for k, parts in state.items():
            if not 0 <= k < len(sizes) or any(parts[key].shape != sizes[k] for key in ("exp_avg", "exp_avg_sq")):
                raise ValueError(f"the optimiser's state {k} has another shape")
        if state and len(state) != len(sizes):
            raise ValueError("part of the optimiser's state is missing")
        return state

    def _values(self) -> dict[str, Any]:
        return dict(self.model.policy.state_dict())


class _Kept:
    """Stands for SB3's buffer of ended episodes: keeps all of a rollout."""

    def __init__(self, ended: list[dict[str, float]]) -> None:
        self._ended = ended

    def extend(self, infos: Any) -> None:
        """Take more."""
        self._ended.extend(infos)


def device_of(name: str) -> str:
    """The device of a config's word.

    Raises:
        ConfigError: it is not there.
    """
    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        raise ConfigError("device is cuda, but torch finds no GPU; set device: auto or cpu")
    return ("cuda" if there else "cpu") if name == "auto" else name
