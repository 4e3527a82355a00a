"""QMIX on the games: a replay of decisions, exploration that fades, the boats' network exported as any other."""

from __future__ import annotations

import time
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.weights_file import write_weights
from steerclear.shield.exceptions import ConfigError
from torch import nn

from .checks import check_options
from .curve import write_curve
from .games import check_sight, learners_of, set_stage, stagger
from .learner import DivergedError
from .networks import TeamFeatures, features_of
from .playing import evaluation_of
from .pool import Pool
from .qmix import MonotoneMixer, Qmix, Transitions
from .settings import TrainingSettings

DEFAULTS = {"replay": 50_000, "batch": 256, "updates": 4, "explore_end": 0.05, "explore_share": 0.5, "rate": 5e-4}
RANGES = {
    "replay": (int, 1, 10**8),
    "batch": (int, 1, 10**7),
    "updates": (int, 1, 1000),
    "explore_end": (float, 0.0, 1.0),
    "explore_share": (float, 1e-6, 1.0),
    "rate": (float, 1e-9, 1e3),
}
"""Moments kept, moments an update, updates a decision of all games, last share of random actions, share of the
training until then, rate of Adam."""


class QmixTraining:
    """QMIX in a folder; checkpoints are not kept: it begins anew.

    Args:
        settings: ``options`` may hold `DEFAULTS`' names; the network is shared, actions are discrete.
        folder: where everything goes.
        resume: refused.

    Raises:
        ConfigError: an option that is unknown or cannot be, or ``resume``.
    """

    def __init__(self, settings: TrainingSettings, folder: Path, resume: bool = False) -> None:
        check_options("qmix", settings.options, RANGES)
        if resume:
            raise ConfigError("qmix begins anew; leave out --resume")
        check_sight(settings)
        self.settings, self.folder, self.decisions = settings, folder, 0
        self.options = {**DEFAULTS, **settings.options}
        torch.manual_seed(settings.seed)
        self._rng = np.random.default_rng([settings.seed, 9])
        pool = Pool(settings.stages[0], settings.league, settings.seed, settings.entrants_every)
        self.batch = learners_of(settings, pool)
        set_stage(self.batch, settings, settings.stages[0], (self.batch.shield, self.batch._filter))
        self.boats = len(self.batch.boats)
        core, features = self.batch.core, features_of(self.batch.core, settings.net.features)
        looks = TeamFeatures(_Space(core.n_obs), features, core.n_obs, settings.interval)
        self.agent = _agent(looks, features.size(core.n_obs), settings)
        mixer = MonotoneMixer(self.boats, self.boats * core.n_obs)
        copies = (deepcopy(self.agent), deepcopy(mixer))
        self.learner = Qmix(self.agent, mixer, copies, float(self.options["rate"]), settings.ppo.discount)
        self._replay = _Replay(int(self.options["replay"]), self.boats, core.n_obs)
        self.curve: list[dict[str, Any]] = []
        self._features = features

    def run(self, notice: Any = lambda done, words: None) -> None:
        """Train to the end."""
        threads = torch.get_num_threads()
        torch.set_num_threads(self.settings.threads)
        try:
            self._train(notice)
        finally:
            torch.set_num_threads(threads)

    def _train(self, notice: Any) -> None:
        seen = self.batch.reset(self.settings.seed)
        stagger(self.batch, self.settings.seed)
        began, losses, nets = time.perf_counter(), [0.0], [0.0]
        while self.decisions < self.settings.decisions:
            seen, loss, ended = self._decide(seen)
            losses.append(loss)
            nets += ended
            if (self.decisions // self.batch.learners) % 200 == 0:
                self._note(losses[-200:], nets[-100:], began)
                notice(self.decisions, f"net {np.mean(nets[-100:]):+.1f} a game")
        for name in ("final.npz", "best.npz"):  # before the evaluation: an error in its games must not lose them
            write_weights(self.network(), self.folder / name)
        self._note(losses[-200:], nets[-100:], began, evaluate=True)

    def _decide(self, seen: Any) -> tuple[Any, float, list[float]]:
        games = self.batch.core.n_games
        with torch.no_grad():
            best = self.agent(torch.as_tensor(seen)).argmax(1).numpy()
        random = self._rng.random(len(best)) < self._exploration()
        actions = np.where(random, self._rng.integers(0, 17, len(best)), best)
        out = self.batch.step(actions)
        shape = (games, self.boats, -1)
        rewards = out.rewards.reshape(games, self.boats).mean(axis=1)
        over = out.terminated.reshape(games, self.boats)[:, 0]
        last = out.final_observations.reshape(shape)
        self._replay.add(seen.reshape(shape), actions.reshape(games, self.boats), rewards, last, over)
        self.decisions += self.batch.learners
        loss = 0.0
        if self._replay.size >= 4 * int(self.options["batch"]):
            for _ in range(int(self.options["updates"])):
                loss = self.learner.update(self._replay.draw(int(self.options["batch"]), self._rng))
            if not np.isfinite(loss):
                raise DivergedError("the loss is no longer finite; lower options.rate, earlier work is kept")
        done = (out.terminated | out.truncated)[:: self.boats]
        net = (out.episodes["captures"] - out.episodes["captures_against"])[:: self.boats]
        return out.observations, loss, net[done].tolist()

    def _exploration(self) -> float:
        end, share = float(self.options["explore_end"]), float(self.options["explore_share"])
        return max(end, 1.0 - (1.0 - end) * self.decisions / max(1.0, share * self.settings.decisions))

    def _note(self, losses: list[float], nets: list[float], began: float, evaluate: bool = False) -> None:
        row = {"decisions": self.decisions, "loss": float(np.mean(losses)), "net": float(np.mean(nets))}
        row["wall"] = {"total_s": time.perf_counter() - began}
        if evaluate:
            row["evaluation"] = evaluation_of(self.settings, self.network())
        self.curve.append(row)
        write_curve(self.folder, self.curve, self.settings)

    def network(self) -> Network:
        """The boats' network in numpy; its outputs are values, whose best is played."""
        layers = [layer for layer in self.agent if isinstance(layer, nn.Linear)]
        weights = [layer.weight.detach().numpy().T[None].copy() for layer in layers]
        biases = [layer.bias.detach().numpy()[None].copy() for layer in layers]
        settings = self.settings
        card = {"trained_with": "steerclear train", "algorithm": "qmix", "preset": settings.preset}
        n_obs, held = self.batch.core.n_obs, settings.interval
        return Network(weights, biases, self._features, settings.net.activation, "discrete", held, n_obs, card)


class _Space:
    """The shape of observations, for `TeamFeatures`."""

    def __init__(self, size: int) -> None:
        self.shape = (size,)


def _agent(looks: nn.Module, size: int, settings: TrainingSettings) -> nn.Sequential:
    act = nn.Tanh if settings.net.activation == "tanh" else nn.ReLU
    layers: list[nn.Module] = [_Each(looks)]
    for width in settings.net.hidden:
        layers += [nn.Linear(size, width), act()]
        size = width
    return nn.Sequential(*layers, nn.Linear(size, 17))


class _Each(nn.Module):
    """Features of (..., n_obs)."""

    def __init__(self, looks: nn.Module) -> None:
        super().__init__()
        self.looks = looks

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        flat = self.looks(seen.reshape(-1, seen.shape[-1]))
        return flat.reshape(*seen.shape[:-1], -1)


class _Replay:
    """The last moments, in a ring."""

    def __init__(self, capacity: int, boats: int, n_obs: int) -> None:
        self.size = self._next = 0
        self._seen = np.zeros((capacity, boats, n_obs), np.float32)
        self._after = np.zeros_like(self._seen)
        self._actions = np.zeros((capacity, boats), np.int64)
        self._rewards, self._ended = np.zeros(capacity, np.float32), np.zeros(capacity, np.float32)

    def add(self, seen: Any, actions: Any, rewards: Any, after: Any, ended: Any) -> None:
        """Add the moments of all games."""
        at = (self._next + np.arange(len(rewards))) % len(self._rewards)
        self._seen[at], self._actions[at], self._rewards[at] = seen, actions, rewards
        self._after[at], self._ended[at] = after, ended
        self._next = int((at[-1] + 1) % len(self._rewards))
        self.size = min(self.size + len(rewards), len(self._rewards))

    def draw(self, count: int, rng: np.random.Generator) -> Transitions:
        """So many at random."""
        at = rng.integers(0, self.size, count)
        seen, after = torch.as_tensor(self._seen[at]), torch.as_tensor(self._after[at])
        numbers = [torch.as_tensor(one[at]) for one in (self._actions, self._rewards, self._ended)]
        return Transitions(seen, seen.flatten(1), numbers[0], numbers[1], after, after.flatten(1), numbers[2])
