"""PPO (Schulman et al. 2017) over the numbers of raids: draws about a network's answers, held for a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from steerclear.policies.entrants.learned.network import Features, Network
from steerclear.policies.entrants.learned.raids import SEEN
from steerclear.policies.entrants.undertow.shape import NAMES
from steerclear.shield.exceptions import ConfigError
from torch import nn

from .config import RaidsConfig
from .policy import ACTIVATIONS, numbers_of
from .training import DivergedError, device_of

NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)
CRITIC_RATE, FIRST_GAIN = 1e-3, 1e-3
Floats = NDArray[np.float32]


@dataclass
class Answer:
    """What was seen and answered, and what came of it until the next.

    Attributes:
        seen: (n,) what the network was told.
        units: (k,) drawn.
        chance: logarithm of the density of that.
        earned: discounted reward until the next answer.
        decisions: time until then.
        after: what it was told then; None: the game, or the raid that it began with, was over.
    """

    seen: Floats
    units: Floats
    chance: float
    earned: float = 0.0
    decisions: int = 0
    after: Floats | None = None


class RaidsLearner:
    """Actor and critic.

    Args:
        config: of the training; what is drawn deviates in units of `shape.LIMITS`.

    Raises:
        ConfigError: the device is not there, or the weights to begin with are of another network.
    """

    def __init__(self, config: RaidsConfig) -> None:
        torch.manual_seed(config.seed)
        self._config, self._learned = config, 0
        self._device = device_of(config.device)
        self._rng = np.random.default_rng([config.seed, 21])
        self.actor, self.critic = _network(config, len(NAMES)), _network(config, 1)
        self.spread = nn.Parameter(torch.full((len(NAMES),), float(np.log(config.options.spread))))
        for part in (self.actor, self.critic):
            part.to(self._device)
        rate = config.ppo.learning_rate
        self._optimiser = torch.optim.Adam([*self.actor.parameters(), self.spread], lr=rate, eps=1e-5)
        self._critics = torch.optim.Adam(self.critic.parameters(), lr=CRITIC_RATE, eps=1e-5)

    def begin_with(self, network: Network) -> None:
        """Put the weights of a network into the actor.

        Raises:
            ConfigError: it is of another shape.
        """
        layers = [layer for layer in self.actor if isinstance(layer, nn.Linear)]
        shapes = [tuple(reversed(layer.weight.shape)) for layer in layers]
        if [weight.shape for weight in network.weights] != [(1, *shape) for shape in shapes]:
            raise ConfigError(f"start does not fit this network of layers {shapes}; give its own net settings")
        with torch.no_grad():
            for layer, weight, bias in zip(layers, network.weights, network.biases, strict=True):
                layer.weight.copy_(torch.as_tensor(weight[0].T))
                layer.bias.copy_(torch.as_tensor(bias[0]))

    def answers(self, seen: Floats) -> list[Answer]:
        """Drawn answers to what is seen (N, n)."""
        with torch.no_grad():
            mean, spread = self.actor(self._tensor(seen)).cpu().numpy(), self.spread.exp().cpu().numpy()
        noise = self._rng.normal(size=mean.shape)
        units = (mean + spread * noise).astype(np.float32)
        chances = (-0.5 * noise**2 - np.log(spread)).sum(axis=1)
        return [Answer(*one) for one in zip(seen, units, chances.tolist(), strict=True)]

    def learn(self, games: Sequence[Sequence[Answer]]) -> dict[str, float]:
        """Learn from a rollout's answers, of each game in order; what there is to tell.

        Raises:
            DivergedError: the loss is not finite.
        """
        answers = [answer for game in games for answer in game]
        seen = self._tensor(np.stack([one.seen for one in answers]))
        units = self._tensor(np.stack([one.units for one in answers]))
        chances = self._tensor(np.array([one.chance for one in answers], np.float32))
        gains, values = self._gains(games, answers, seen)
        wanted, gain = self._tensor(gains + values), self._tensor((gains - gains.mean()) / (gains.std() + 1e-8))
        ppo, further, far = self._config.ppo, self._learned >= self._config.ppo.critic_first, [0.0]
        for _ in range(ppo.epochs):
            for some in torch.as_tensor(self._rng.permutation(len(answers))).split(ppo.batch):
                self._step(self._critics, ((self.critic(seen[some])[:, 0] - wanted[some]) ** 2).mean())
                if further:
                    far.append(self._improve(seen[some], units[some], chances[some], gain[some]))
            further = further and float(np.mean(far[-3:])) <= self._config.options.furthest
        self._learned += 1
        explained = 1.0 - float(np.mean(gains**2) / (np.var(gains + values) + 1e-9))
        return {"answers": len(answers), "explained": explained, "divergence": far[-1], "spread": self._mean_spread()}

    def _gains(self, games: Any, answers: Sequence[Answer], seen: Any) -> tuple[Floats, Floats]:
        """Advantages by GAE over times of different lengths, and values, of all answers."""
        ppo = self._config.ppo
        after = self._tensor(np.stack([one.seen if one.after is None else one.after for one in answers]))
        with torch.no_grad():
            values, later = (self.critic(told)[:, 0].cpu().numpy() for told in (seen, after))
        gains, at = np.zeros(len(answers), np.float32), len(answers)
        for game in reversed(games):
            last = 0.0
            for one in reversed(game):
                at -= 1
                left = 0.0 if one.after is None else ppo.discount**one.decisions
                last = one.earned + left * later[at] - values[at] + left * ppo.gae_lambda * last
                gains[at] = last
        return gains, values

    def _improve(self, seen: Any, units: Any, chances: Any, gain: Any) -> float:
        """A step of the actor; how far it is from who answered."""
        ppo = self._config.ppo
        now = (-0.5 * ((units - self.actor(seen)) / self.spread.exp()) ** 2 - self.spread).sum(1)
        ratio = torch.exp(now - chances)
        kept = torch.minimum(ratio * gain, ratio.clamp(1.0 - ppo.clip, 1.0 + ppo.clip) * gain)
        self._step(self._optimiser, -kept.mean() - ppo.entropy * self.spread.sum())
        return float((ratio - 1.0 - (now - chances)).mean().detach())

    def _step(self, optimiser: Any, loss: Any) -> None:
        if not torch.isfinite(loss):
            raise DivergedError("the loss is no longer finite; lower ppo.learning_rate, earlier work is kept")
        optimiser.zero_grad()
        loss.backward()
        for group in optimiser.param_groups:
            nn.utils.clip_grad_norm_(group["params"], self._config.ppo.max_grad_norm)
        optimiser.step()

    def _mean_spread(self) -> float:
        return float(self.spread.detach().exp().mean())

    def _tensor(self, numbers: Any) -> Any:
        return torch.as_tensor(np.asarray(numbers, np.float32), device=self._device)

    def network(self, card: dict[str, Any]) -> Network:
        """The actor in numpy."""
        weights, biases = numbers_of(self.actor)
        config, n = self._config, weights[0].shape[1]
        return Network(weights, biases, NONE, config.net.activation, "raids", config.interval, n, card)


def _network(config: RaidsConfig, outputs: int) -> nn.Sequential:
    """Layers; the last begins near nothing, so that raids begin as the script's."""
    found: list[nn.Module] = []
    for before, after in pairwise((SEEN, *config.net.hidden, outputs)):
        found += [nn.Linear(before, after), ACTIVATIONS[config.net.activation]()]
        nn.init.orthogonal_(found[-2].weight, 2.0**0.5)
        nn.init.zeros_(found[-2].bias)
    nn.init.orthogonal_(found[-2].weight, FIRST_GAIN)
    return nn.Sequential(*found[:-1])
