"""`PpoTraining`: Stable-Baselines3's PPO on the games of a training, with a curriculum, a league and checkpoints."""

from __future__ import annotations

import time
from collections import deque
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.sb3_file import TAKES_OVER
from steerclear.policies.entrants.learned.weights_file import joined, read_weights, write_weights
from steerclear.shield.exceptions import ConfigError

from .checkpoints import newest, read_checkpoint, write_checkpoint, write_model
from .config import SELF, PpoConfig
from .env import TrainEnv, carriers_of
from .policy import ACTIVATIONS, BoatPolicy, TeamFeatures, features_of, load_actor, network_of
from .training import DivergedError, Notice, Training, card_of, device_of, means, threads

MODEL, SNAPSHOTS = "model.zip", "snapshots"
TOLD = ("r", "l", "captures", "captures_against", "grabs", "grabs_against", "tags", "tags_against", "hits")
ONE_OF_TWO = "give weights of a single network, such as play/final.npz of a training by qmix+ppo"
MAY_DIFFER = ("decisions", "checkpoint_every", "device")
"""Keys of a config that a training that is gone on with may have otherwise."""
_NOT_OURS = (KeyError, ValueError, TypeError, IndexError, AttributeError, RuntimeError, OverflowError)
"""What putting back parts that are missing or of another kind raises."""


class PpoTraining(Training):
    """A training by PPO in a folder.

    Args:
        config: what it is to be.
        folder: where everything goes.
        resume: go on from the folder's last checkpoint.

    Raises:
        ConfigError: an unusable setting or checkpoint.
    """

    def __init__(self, config: PpoConfig, folder: Path, resume: bool = False) -> None:
        super().__init__(config, folder)
        self.first = _single(config.options.first, "first") if config.options.first else None
        self.env = TrainEnv(config, self.first)
        self.core = self.env.batch.core
        self._check_first()
        self.model = _ppo(config, self.env)
        self._card = {**card_of(config), TAKES_OVER: self.first is not None}
        if config.start:
            _begin_with(self.model, config.start)
        self.stage_began = self.rollouts = 0
        self._wall_s = 0.0
        self._recent: deque[float] = deque(maxlen=config.stages[0].games)
        self._begin(config.seed)
        if resume:
            self._resume()
        self._kept = self._packed()

    def _check_first(self) -> None:
        needed = {"n_obs": self.core.n_obs, "interval": self.config.interval, "kind": "discrete"}
        for name, value in needed.items() if self.first is not None else ():
            if getattr(self.first, name) != value or self.config.actions != "discrete":
                raise ConfigError(
                    f"first: {self.config.options.first} has another {name} than the games, which need {value}"
                )

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Train to the end; what is interrupted keeps all up to the last whole rollout.

        Raises:
            DivergedError: a number of the network or loss is not finite.
        """
        with threads(self.config.threads):
            try:
                self._make_up_for_evaluation()
                left = self.total - self.decisions
                if left > 0:
                    self.model.learn(left, _Rollouts(self, notice), None, reset_num_timesteps=False)
            except ValueError as error:  # torch's distributions refuse parameters that are not finite
                if self._finite():
                    raise
                raise DivergedError(_diverged()) from error
            finally:
                write_checkpoint(self.folder, self._kept[0])
                self.write_curve(self._kept[1])
        self.write_last()
        write_model(self.model, self.folder / MODEL, self._card)

    def end_rollout(self, wall: dict[str, float]) -> str:
        """Note what a rollout brought, go on in the curriculum and league, evaluate, keep; words for people."""
        began = time.perf_counter()
        told = {name: float(value) for name, value in self.model.logger.name_to_value.items()}
        self.model.logger.name_to_value.clear()
        self.model.logger.name_to_count.clear()
        if not np.isfinite(told.get("train/loss", 0.0)) or not self._finite():
            raise DivergedError(_diverged())
        self.rollouts += 1
        self.decisions = self.model.num_timesteps
        games = self.env.ended()
        row = {"decisions": self.decisions, "stage": self.env.stage, **means(games, (*TOLD, "interventions"))}
        row |= {name.removeprefix("train/"): value for name, value in told.items()}
        self._promote([one["captures"] - one["captures_against"] for one in games])
        if self.env.batch.opponent.learns and self.rollouts % self.config.league.every == 0:
            self._add_snapshot()
        self._wall_s += sum(wall.values())
        row["wall"] = {"total_s": self._wall_s, **wall}
        self.curve.append(row)
        if self._due():
            self._kept = self._packed()  # what was learned is kept, whatever the games of an evaluation meet
            row["evaluation"] = self.evaluate()
        self._wall_s += time.perf_counter() - began
        row["wall"]["total_s"] = self._wall_s
        self._kept = self._packed()
        if self.rollouts % self.config.checkpoint_every == 0:
            write_checkpoint(self.folder, self._kept[0])
            self.write_curve(self.curve)
        return self._words(row, sum(wall.values()))

    def _finite(self) -> bool:
        return all(bool(torch.isfinite(one).all()) for one in self.model.policy.parameters())

    def _promote(self, nets: list[float]) -> None:
        """Go to the next stage where this one's rule is met."""
        self._recent.extend(nets)
        number = self.env.stage
        stage = self.config.stages[number]
        if number + 1 >= len(self.config.stages):
            return
        full = len(self._recent) == stage.games and float(np.mean(self._recent)) >= stage.net
        if full or 0 < stage.most <= self.decisions - self.stage_began:
            self.stage_began = self.decisions
            self._recent = deque(maxlen=self.config.stages[number + 1].games)
            self.env.enter(number + 1)
            if self.env.batch.opponent.learns:
                self._add_snapshot()
            self._begin(self.config.seed + self.decisions)

    def _begin(self, seed: int) -> None:
        """Start all games of the stage."""
        pool = self.env.batch.opponent
        if pool.learns and not pool.members:
            self._add_snapshot()
        self.model._last_obs = self.env.begin(seed)
        self.model._last_episode_starts = np.ones(self.env.num_envs, bool)

    def _add_snapshot(self) -> None:
        network = self.network()
        write_weights(network, self.folder / SNAPSHOTS / f"{SELF}_{self.rollouts}.npz")
        self.env.batch.opponent.add_snapshot(network, self.rollouts)

    def _due(self) -> bool:
        """Whether this rollout ends with an evaluation."""
        return self.rollouts % self.config.evaluation.every == 0 or self.decisions >= self.total

    def _make_up_for_evaluation(self) -> None:
        """Play the evaluation that an error kept from the training that is gone on with."""
        if self.curve and self._due() and "evaluation" not in self.curve[-1]:
            self.curve[-1]["evaluation"] = self.evaluate()
            self._kept = self._packed()

    def network(self) -> Network:
        """The actor as it is now, behind the network that plays until the flag is held, where there is one."""
        own = network_of(self.model.policy, self.config.net.activation, card_of(self.config))
        return own if self.first is None else joined(self.first, own, carriers_of(self.core))

    def _packed(self) -> tuple[bytes, list[dict[str, Any]]]:
        """A checkpoint of this moment, and the curve."""
        kind, keys, position, has_gauss, cached = np.random.get_state()  # noqa: NPY002 (SB3 shuffles with it)
        facts = {
            "settings": self.config.model_dump(mode="json"),
            "rollouts": self.rollouts,
            "decisions": self.decisions,
            "stage": self.env.stage,
            "stage_began": self.stage_began,
            "best": self.best if np.isfinite(self.best) else None,
            "wall_s": self._wall_s,
            "recent": list(self._recent),
            "seed": self.env.batch._seed,
            "pool": self.env.batch.opponent.facts(),
            "rng": [kind, keys.tolist(), position, has_gauss, cached],
            "updates": self.model._n_updates,
            "curve": self.curve,
        }
        own = {"torch": torch.get_rng_state().numpy(), "last_obs": self.model._last_obs}
        own["starts"] = self.model._last_episode_starts
        file = BytesIO()
        write_model(self.model, file, self._card, facts, {**self.env.arrays(), **own})
        return file.getvalue(), list(self.curve)

    def _resume(self) -> None:
        """Go on from the last whole checkpoint.

        Raises:
            ConfigError: it is of another training or version, or damaged.
        """
        path = newest(self.folder)
        if path is None:
            return
        facts, arrays = read_checkpoint(path)
        try:
            self._check_same(facts["settings"])
            self._put_back(path, facts, arrays)
        except ConfigError:
            raise  # a kind of ValueError; says already what to do
        except _NOT_OURS as error:
            why = f"{error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())[:120]
            raise ConfigError(
                f"{path} is damaged or of another version ({why or type(error).__name__}); delete it to go on from the "
                "one before, or begin anew in another --out"
            ) from error

    def _check_same(self, before: dict[str, Any]) -> None:
        now = self.config.model_dump(mode="json")
        for name in now:
            if name not in MAY_DIFFER and now[name] != before.get(name):
                raise ConfigError(
                    f"{self.folder} was begun with another {name}; resume with its own config.yaml, or name another "
                    "--out"
                )

    def _put_back(self, path: Path, facts: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Go on from what `_packed` told."""
        self.rollouts, self.decisions, self.curve = facts["rollouts"], facts["decisions"], facts["curve"]
        self.stage_began, self._wall_s = facts["stage_began"], facts["wall_s"]
        self.best = -np.inf if facts["best"] is None else facts["best"]
        self._recent = deque(facts["recent"], maxlen=self.config.stages[facts["stage"]].games)
        self.env.enter(facts["stage"])
        snapshots = self.folder / SNAPSHOTS
        self.env.put(arrays, facts["seed"], facts["pool"], lambda name: read_weights(snapshots / f"{name}.npz"))
        self.model.set_parameters(str(path), device=self.model.device)
        self.model.num_timesteps, self.model._n_updates = self.decisions, facts["updates"]
        if arrays["last_obs"].shape != self.model._last_obs.shape or arrays["starts"].shape != (self.env.num_envs,):
            raise ValueError("last observations have another shape")
        self.model._last_obs, self.model._last_episode_starts = arrays["last_obs"], arrays["starts"]
        torch.set_rng_state(torch.as_tensor(arrays["torch"]))
        kind, keys, *rest = facts["rng"]
        np.random.set_state((kind, np.array(keys, np.uint32), *rest))  # noqa: NPY002

    def _words(self, row: dict[str, Any], spent_s: float) -> str:
        """What the progress says: means of the games that ended in the last rollout, and its rate."""
        rate = self.config.ppo.steps * self.env.num_envs / max(spent_s, 1e-9)
        stage = f"stage {self.env.stage + 1}/{len(self.config.stages)}"
        if not row["games"]:
            return f"{stage}, {rate:,.0f} decisions/s"
        counts = f"captures {row['captures']:.1f}, against {row['captures_against']:.1f}, hits {row['hits']:.1f}"
        return f"{stage}, {counts} a game, {rate:,.0f} decisions/s"


class _Rollouts(BaseCallback):
    """Tells a training when a rollout was played and learned from: at the start of the next, or at the end."""

    def __init__(self, training: PpoTraining, notice: Notice) -> None:
        super().__init__()
        self._training, self._notice = training, notice
        self._played_s: float | None = None

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self._end()
        self._began_s, self._played_s = time.perf_counter(), None

    def _on_rollout_end(self) -> None:
        self._played_s = time.perf_counter()

    def _on_training_end(self) -> None:
        self._end()

    def _end(self) -> None:
        if self._played_s is None:
            return
        learning_s = time.perf_counter() - self._played_s
        parts = self._training.env.taken()
        acting_s = self._played_s - self._began_s - sum(parts.values())
        words = self._training.end_rollout({**parts, "acting_s": acting_s, "learning_s": learning_s})
        self._played_s = None
        self._notice(self._training.decisions, words)


def _diverged() -> str:
    return "the loss is no longer finite; lower ppo.learning_rate or the reward weights, earlier work is kept"


def _ppo(config: PpoConfig, env: TrainEnv) -> PPO:
    """SB3's PPO of a config; the actor learns nothing while the critic learns alone."""
    ppo, net, batch = config.ppo, config.net, env.batch
    looks = {
        "features": features_of(batch.core, net.features),
        "n_obs": batch.core.n_obs,
        "interval": batch.interval,
        "places": len(batch.boats) if net.roles == "placed" else 0,
    }
    model = PPO(
        BoatPolicy,
        env,
        n_steps=ppo.steps,
        batch_size=min(ppo.batch, ppo.steps * env.num_envs),
        n_epochs=ppo.epochs,
        learning_rate=ppo.learning_rate,
        gamma=ppo.discount,
        gae_lambda=ppo.gae_lambda,
        clip_range=ppo.clip,
        ent_coef=ppo.entropy,
        vf_coef=ppo.value,
        max_grad_norm=ppo.max_grad_norm,
        policy_kwargs={
            "net_arch": {"pi": list(net.hidden), "vf": list(net.hidden)},
            "activation_fn": ACTIVATIONS[net.activation],
            "features_extractor_class": TeamFeatures,
            "features_extractor_kwargs": looks,
            "roles": len(batch.boats) if net.roles == "each" else 1,
        },
        device=device_of(config.device),
        seed=config.seed,
    )
    model.set_logger(Logger(None, []))

    def held_back(gradient: torch.Tensor) -> torch.Tensor:
        alone = model._n_updates < ppo.critic_first * ppo.epochs
        return torch.zeros_like(gradient) if alone else gradient

    for name, parameter in model.policy.named_parameters():
        if "policy" in name or name.startswith(("action_net", "log_std")):
            parameter.register_hook(held_back)
    return model


def _single(path: str, what: str) -> Network:
    """The network of a file that holds one.

    Raises:
        ConfigError: it holds two.
    """
    network = read_weights(path)
    if network.carrying is not None:
        raise ConfigError(f"{what} {path} holds two networks; {ONE_OF_TWO}")
    return network


def _begin_with(model: PPO, path: str) -> None:
    try:
        load_actor(model.policy, _single(path, "start"))
    except ConfigError:
        raise  # a kind of ValueError
    except ValueError as error:
        raise ConfigError(f"start {path} does not fit this network: {error}; give its own net settings") from None
