"""QMIX (Rashid et al. 2018): values of each boat's actions, mixed monotonically into one value of the team.

Q_tot(s, u) = f_s(Q_1(o_1, u_1), ..., Q_n(o_n, u_n)) with df_s / dQ_i >= 0, so each boat's best action is the team's.
The weights of f are made from the state by networks of their own, their absolute values taken. On the games: a replay
of decisions, exploration that fades, the boats' network exported as any other.

`TwoPartTraining` is QMIX for play, then PPO for what to do once the flag is held: Richley-NIWC-ATL's team.
"""

from __future__ import annotations

import time
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.torch_layers import create_mlp
from steerclear.policies.entrants.learned.network import Network, read_weights
from steerclear.shield.wrappers.actions import DISCRETE
from torch import nn

from .config import Config, Part, QmixOptions
from .env import TrainEnv
from .policy import ACTIVATIONS, TeamFeatures, features_of, numbers_of
from .ppo import PpoTraining, newest, read_checkpoint
from .training import FINAL, DivergedError, Notice, Training, card_of, threads

PLAY = "play"
"""Folder of the first of two parts."""
TARGET_EVERY = 100
"""Updates between copies to the target networks."""


class Transitions(NamedTuple):
    """N moments of a team of n boats; the mixer's state is what all of them see, (N, n * obs).

    Attributes:
        seen: (N, n, obs) what each boat saw.
        actions: (N, n) whole numbers.
        rewards: (N,) of the team.
        next_seen: (N, n, obs) what each saw a decision later.
        ended: (N,) 1.0 where no reward can follow.
    """

    seen: torch.Tensor
    actions: torch.Tensor
    rewards: torch.Tensor
    next_seen: torch.Tensor
    ended: torch.Tensor


class MonotoneMixer(nn.Module):
    """The f_s above for so many boats and numbers in a state: one hidden layer of ELU with weights >= 0."""

    def __init__(self, boats: int, state: int, hidden: int = 32) -> None:
        super().__init__()
        self.boats, self.hidden = boats, hidden
        self.first = nn.Linear(state, boats * hidden)
        self.first_bias = nn.Linear(state, hidden)
        self.second = nn.Linear(state, hidden)
        self.value = nn.Sequential(nn.Linear(state, hidden), nn.ReLU(), nn.Linear(hidden, 1))

    def forward(self, values: torch.Tensor, state: torch.Tensor) -> torch.Tensor:
        """Q_tot (N,) of values (N, n) at states (N, s)."""
        weights = self.first(state).abs().view(-1, self.boats, self.hidden)
        hidden = nn.functional.elu(torch.bmm(values[:, None], weights)[:, 0] + self.first_bias(state))
        mixed: torch.Tensor = (hidden * self.second(state).abs()).sum(1) + self.value(state)[:, 0]
        return mixed


class Qmix:
    """Learner of an agent (from what a boat sees to its actions' values) and mixer, with target networks, double Q."""

    def __init__(self, agent: nn.Module, mixer: nn.Module, rate: float, discount: float) -> None:
        self.agent, self.mixer, self.discount, self.updates = agent, mixer, discount, 0
        self.agent_target, self.mixer_target = deepcopy(agent), deepcopy(mixer)
        self._parameters = [*agent.parameters(), *mixer.parameters()]
        self.optimiser = torch.optim.Adam(self._parameters, lr=rate)

    def loss(self, batch: Transitions) -> torch.Tensor:
        """Mean squared error of r + discount * Q_tot'(s', argmax Q) over transitions."""
        chosen = self.agent(batch.seen).gather(2, batch.actions[..., None])[..., 0]
        with torch.no_grad():
            best = self.agent(batch.next_seen).argmax(2, keepdim=True)
            after = self.agent_target(batch.next_seen).gather(2, best)[..., 0]
            future = self.mixer_target(after, batch.next_seen.flatten(1))
            target = batch.rewards + self.discount * (1.0 - batch.ended) * future
        return nn.functional.mse_loss(self.mixer(chosen, batch.seen.flatten(1)), target)

    def update(self, batch: Transitions) -> float:
        """One step of Adam; the loss before it."""
        loss = self.loss(batch)
        self.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self._parameters, 10.0)
        self.optimiser.step()
        self.updates += 1
        if self.updates % TARGET_EVERY == 0:
            self.agent_target.load_state_dict(self.agent.state_dict())
            self.mixer_target.load_state_dict(self.mixer.state_dict())
        return float(loss.detach())


class QmixTraining(Training):
    """QMIX in a folder: one network for all boats, discrete actions; checkpoints are not kept, it begins anew."""

    def __init__(self, config: Config, folder: Path, resume: bool = False) -> None:
        super().__init__(config, folder)
        torch.manual_seed(config.seed)
        self._rng = np.random.default_rng([config.seed, 9])
        self.env = TrainEnv(config)
        core = self.env.batch.core
        self.boats, self._features = len(self.env.batch.boats), features_of(core, config.net.features)
        looks = TeamFeatures(self.env.observation_space, self._features, core.n_obs, config.interval)
        hidden, act = list(config.net.hidden), ACTIVATIONS[config.net.activation]
        self.agent = nn.Sequential(looks, *create_mlp(looks.features_dim, len(DISCRETE), hidden, act))
        mixer = MonotoneMixer(self.boats, self.boats * core.n_obs)
        self.learner = Qmix(self.agent, mixer, config.options.rate, config.ppo.discount)
        self._replay = _Replay(config.options.replay, self.boats, core.n_obs)

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Train to the end."""
        with threads(self.config.threads):
            seen = self.env.begin(self.config.seed)
            began, losses, nets, learners = time.perf_counter(), [0.0], [0.0], self.env.num_envs
            while self.decisions < self.total:
                seen, loss = self._decide(seen)
                losses.append(loss)
                nets += [one["captures"] - one["captures_against"] for one in self.env.ended()]
                if (self.decisions // learners) % 200 == 0:
                    self._note(losses[-200:], nets[-100:], began)
                    notice(self.decisions, f"net {np.mean(nets[-100:]):+.1f} a game")
            self.write_last()  # before the evaluation: an error in its games must not lose them
            self._note(losses[-200:], nets[-100:], began, evaluate=True)

    def _decide(self, seen: Any) -> tuple[Any, float]:
        """A decision of all games; what is seen then, and the loss of what was learned."""
        games, options = self.config.games, self.config.options
        with torch.no_grad():
            best = self.agent(torch.as_tensor(seen)).argmax(1).numpy()
        end, whole = options.explore_end, max(1.0, options.explore_share * self.total)
        random = self._rng.random(len(best)) < max(end, 1.0 - (1.0 - end) * self.decisions / whole)
        actions = np.where(random, self._rng.integers(0, len(DISCRETE), len(best)), best)
        out = self.env.decide(actions)
        shape = (games, self.boats, -1)
        rewards = out.rewards.reshape(games, self.boats).mean(axis=1)
        over = out.terminated.reshape(games, self.boats)[:, 0]
        last = out.final_observations.reshape(shape)
        self._replay.add(seen.reshape(shape), actions.reshape(games, self.boats), rewards, last, over)
        self.decisions += self.env.num_envs
        loss = 0.0
        if self._replay.size >= 4 * options.batch:
            for _ in range(options.updates):
                loss = self.learner.update(self._replay.draw(options.batch, self._rng))
            if not np.isfinite(loss):
                raise DivergedError("options.rate")
        return out.observations, loss

    def _note(self, losses: list[float], nets: list[float], began: float, evaluate: bool = False) -> None:
        row = {"decisions": self.decisions, "loss": float(np.mean(losses)), "net": float(np.mean(nets))}
        row["wall"] = {"total_s": time.perf_counter() - began}
        if evaluate:
            row["evaluation"] = self.evaluate()
        self.curve.append(row)
        self.write_curve(self.curve)

    def network(self) -> Network:
        """The boats' network in numpy; its outputs are values, whose best is played."""
        config, card = self.config, {**card_of(self.config), "algorithm": "qmix"}
        about = (self._features, config.net.activation, "discrete", config.interval, self.env.batch.core.n_obs, card)
        return Network(*numbers_of(self.agent), *about)


class _Replay:
    """The last moments, in a ring, in the order of `Transitions`."""

    def __init__(self, capacity: int, boats: int, n_obs: int) -> None:
        self.size = self._next = 0
        seen, numbers = (capacity, boats, n_obs), (capacity,)
        shapes = ((seen, np.float32), ((capacity, boats), np.int64), (numbers, np.float32), (seen, np.float32))
        self._kept = [np.zeros(*one) for one in (*shapes, (numbers, np.float32))]

    def add(self, *moments: Any) -> None:
        """Add the moments of all games."""
        capacity, count = len(self._kept[0]), len(moments[0])
        at = (self._next + np.arange(count)) % capacity
        for kept, values in zip(self._kept, moments, strict=True):
            kept[at] = values
        self._next = int((at[-1] + 1) % capacity)
        self.size = min(self.size + count, capacity)

    def draw(self, count: int, rng: np.random.Generator) -> Transitions:
        """So many at random."""
        at = rng.integers(0, self.size, count)
        return Transitions(*(torch.as_tensor(kept[at]) for kept in self._kept))


class TwoPartTraining:
    """QMIX in the folder ``play``, then PPO in the folder itself; resumed, a first part that is done is kept.

    The first stage is QMIX's, all are PPO's; arguments and errors are as of `PpoTraining`.
    """

    def __init__(self, config: Config, folder: Path, resume: bool = False) -> None:
        self.config, self.folder, self.resume = config, folder, resume
        self.decisions, self.total = 0, config.decisions
        self._of_play = max(1, int(config.options.play_share * config.decisions))
        self._play = None
        if not (resume and (folder / PLAY / FINAL).exists()):
            options = QmixOptions(**{name: getattr(config.options, name) for name in QmixOptions.model_fields})
            own = {"algorithm": "qmix", "device": "auto", "stages": config.stages[:1], "decisions": self._of_play}
            own |= {"options": options, "net": config.net.model_copy(update={"roles": "shared"})}
            self._play = QmixTraining(config.model_copy(update=own), folder / PLAY)
        elif found := newest(folder):
            self.decisions = self._of_play + int(read_checkpoint(found)[0]["decisions"])

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Train both parts to the end."""
        if self._play is not None:
            self._play.folder.mkdir(parents=True, exist_ok=True)
            self._play.run(lambda done, words: notice(done, f"play, {words}"))
        left = {"algorithm": "ppo", "decisions": max(1, self.total - self._of_play), "options": Part()}
        first = read_weights(self.folder / PLAY / FINAL)
        second = PpoTraining(self.config.model_copy(update=left), self.folder, self.resume, first)
        second.run(lambda done, words: notice(self._of_play + done, f"with the flag, {words}"))
        self.decisions = self.total
