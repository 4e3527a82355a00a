"""`PpoTraining`: Stable-Baselines3's PPO on the games of a training, with a curriculum, a league and checkpoints.

A checkpoint is a model as Stable-Baselines3 saves it, and the state of the games beside; none of its pickles is read.
"""

from __future__ import annotations

import json
import time
import zipfile
import zlib
from collections import deque
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned.network import Network, joined, read_weights, write_weights
from steerclear.policies.entrants.learned.sb3_file import TAKES_OVER, add_card
from steerclear.shield.exceptions import ConfigError

from .config import SELF, Config
from .env import TrainEnv
from .policy import ACTIVATIONS, BoatPolicy, TeamFeatures, features_of, load_actor, network_of
from .training import DivergedError, Notice, Training, card_of, device_of, means, threads

MODEL, SNAPSHOTS, CHECKPOINTS, KEEP = "model.zip", "snapshots", "checkpoints", 2
FACTS, ARRAYS = "steerclear_training.json", "steerclear_games.npz"
TOLD = ("r", "l", "captures", "captures_against", "grabs", "grabs_against", "tags", "tags_against", "hits")
MAY_DIFFER = ("decisions", "checkpoint_every", "device", "shield_threads")
"""Keys of a config that a training that is gone on with may have otherwise."""
_DAMAGED = (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError, zlib.error)
_NOT_OURS = (KeyError, ValueError, TypeError, IndexError, AttributeError, RuntimeError, OverflowError)
"""What putting back parts that are missing or of another kind raises."""


class Kept(NamedTuple):
    """What is written where a training stops: a checkpoint, and the curve until then."""

    rollouts: int
    checkpoint: bytes
    curve: list[dict[str, Any]]


class PpoTraining(Training):
    """A training by PPO in a folder, of a network that takes over from ``first`` while the flag is held, if given.

    Raises:
        ConfigError: an unusable setting or checkpoint.
    """

    def __init__(self, config: Config, folder: Path, resume: bool = False, first: Network | None = None) -> None:
        super().__init__(config, folder)
        self.env = TrainEnv(config, first)
        self.model = _ppo(config, self.env)
        if config.start:
            self._begin_with(config.start)
        self.stage_began = self.rollouts = 0
        self._wall_s = 0.0
        self._recent: deque[float] = deque(maxlen=config.stages[0].games)
        self._begin(config.seed)
        if resume:
            self._resume()
        self._kept = self._packed()

    def _begin_with(self, path: str) -> None:
        """Put the weights of a file into the actor."""
        network = read_weights(path)
        if network.carrying is not None:
            raise ConfigError(f"start {path} holds two networks; give weights of a single one")
        try:
            load_actor(self.model.policy, network)
        except ValueError as error:
            words = f"start {path} does not fit this network: {error}; give its own net settings"
            raise ConfigError(words) from None

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Train to the end; what is interrupted keeps all up to the last whole rollout."""
        with threads(self.config.threads):
            try:
                if self.curve and self._due() and "evaluation" not in self.curve[-1]:  # an error kept it from it
                    self.curve[-1]["evaluation"] = self.evaluate()
                    self._kept = self._packed()
                left = self.total - self.decisions
                if left > 0:
                    self.model.learn(left, _Rollouts(self, notice), None, reset_num_timesteps=False)
            except ValueError as error:  # torch's distributions refuse parameters that are not finite
                if self._finite():
                    raise
                raise DivergedError("ppo.learning_rate or the reward weights") from error
            finally:
                self._write_checkpoint()
                self.write_curve(self._kept.curve)
        self.write_last()
        with whole_file(self.folder / MODEL, ConfigError) as part:
            part.write_bytes(self._saved().getvalue())

    def end_rollout(self, wall: dict[str, float]) -> str:
        """Note what a rollout brought, go on in the curriculum and league, evaluate, keep; words for people."""
        began = time.perf_counter()
        told = {name: float(value) for name, value in self.model.logger.name_to_value.items()}
        self.model.logger.name_to_value.clear()
        self.model.logger.name_to_count.clear()
        if not np.isfinite(told.get("train/loss", 0.0)) or not self._finite():
            raise DivergedError("ppo.learning_rate or the reward weights")
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
            self._write_checkpoint()
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

    def network(self) -> Network:
        """The actor as it is now, behind the network that plays until the flag is held, where there is one."""
        own, first = network_of(self.model.policy, self.config.net.activation, card_of(self.config)), self.env.first
        return own if first is None else joined(first, own, first.carriers)

    def _saved(self) -> BytesIO:
        """The model with its card."""
        file = BytesIO()
        self.model.save(file)
        add_card(file, {**card_of(self.config), TAKES_OVER: self.env.first is not None})
        return file

    def _packed(self) -> Kept:
        """A checkpoint of this moment, and the curve."""
        kind, keys, position, has_gauss, cached = np.random.get_state()  # noqa: NPY002 (SB3 shuffles with it)
        arrays = {**self.env.arrays(), "torch": torch.get_rng_state().numpy(), "last_obs": self.model._last_obs}
        arrays["starts"] = self.model._last_episode_starts
        facts = {
            "settings": self.config.told(),
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
            "names": list(arrays),
        }
        content, file = BytesIO(), self._saved()
        np.savez(content, **{f"a{k}": array for k, array in enumerate(arrays.values())})
        with zipfile.ZipFile(file, "a") as archive:
            archive.writestr(FACTS, json.dumps(facts))
            archive.writestr(ARRAYS, content.getvalue())
        return Kept(self.rollouts, file.getvalue(), list(self.curve))

    def _write_checkpoint(self) -> None:
        """Write what is kept, then forget all but the last `KEEP` checkpoints."""
        folder = self.folder / CHECKPOINTS
        with whole_file(folder / f"{self._kept.rollouts:08d}.zip", ConfigError) as part:
            part.write_bytes(self._kept.checkpoint)
        for old in sorted(folder.glob("[0-9]*.zip"))[:-KEEP]:
            old.unlink(missing_ok=True)

    def _resume(self) -> None:
        """Go on from the last whole checkpoint, where there is one."""
        path = newest(self.folder)
        if path is None:
            return
        facts, arrays = read_checkpoint(path)
        try:
            for name, now in self.config.told().items():
                if name not in MAY_DIFFER and now != facts["settings"].get(name):
                    raise ConfigError(
                        f"{self.folder} was begun with another {name}; resume with its own config.yaml, or name "
                        "another --out"
                    )
            self._put_back(path, facts, arrays)
        except ConfigError:
            raise  # a kind of ValueError; says already what to do
        except _NOT_OURS as error:
            why = f"{error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())[:120]
            raise ConfigError(
                f"{path} is damaged or of another version ({why or type(error).__name__}); delete it to go on from the "
                "one before, or begin anew in another --out"
            ) from error

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
        self._on_training_end()
        self._began_s, self._played_s = time.perf_counter(), None

    def _on_rollout_end(self) -> None:
        self._played_s = time.perf_counter()

    def _on_training_end(self) -> None:
        if self._played_s is None:
            return
        learning_s = time.perf_counter() - self._played_s
        parts = self._training.env.taken()
        acting_s = self._played_s - self._began_s - sum(parts.values())
        words = self._training.end_rollout({**parts, "acting_s": acting_s, "learning_s": learning_s})
        self._played_s = None
        self._notice(self._training.decisions, words)


def newest(folder: Path) -> Path | None:
    """The last checkpoint of a training; None where there is none."""
    found = sorted((folder / CHECKPOINTS).glob("[0-9]*.zip"))
    if not found and any((folder / CHECKPOINTS).glob("[0-9]*.npz")):
        raise ConfigError(
            f"{folder} holds a training of 0.8.0 or before, which only that version goes on with; its best.npz and "
            "final.npz play here and can be the start of another (start), in another --out"
        )
    return found[-1] if found else None


def read_checkpoint(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Facts and arrays of a checkpoint."""
    try:
        with zipfile.ZipFile(path) as archive:
            facts, content = json.loads(archive.read(FACTS)), BytesIO(archive.read(ARRAYS))
        with np.load(content, allow_pickle=False) as found:
            return facts, {name: found[f"a{k}"] for k, name in enumerate(facts["names"])}
    except _DAMAGED as error:
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise ConfigError(f"{path} is no whole checkpoint ({why}); delete it to go on from the one before") from error


def _ppo(config: Config, env: TrainEnv) -> PPO:
    """SB3's PPO of a config."""
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

    def held_back(gradient: torch.Tensor) -> torch.Tensor:  # in the first updates the critic learns alone
        return torch.zeros_like(gradient) if model._n_updates < ppo.critic_first * ppo.epochs else gradient

    for name, parameter in model.policy.named_parameters():
        if "policy" in name or name.startswith(("action_net", "log_std")):
            parameter.register_hook(held_back)
    return model
