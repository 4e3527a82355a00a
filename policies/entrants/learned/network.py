"""`Network`: a learned policy in numpy, from observations to actions; no torch, no pickles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.wrappers.actions import DISCRETE

from ..undertow.shape import NAMES

Floats = NDArray[np.float32]
ACTIVATIONS = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0)}
KINDS = {"discrete": 17, "normalised": 2, "raids": len(NAMES)}
"""Outputs by kind: action values; the mean of (speed, relative heading) scaled to [-1, 1]; the numbers of a raid, see
`raids`."""


@dataclass(frozen=True)
class Features:
    """What a network is given of an observation in [-1, 1].

    Angles a are replaced by sin(pi a) and cos(pi a), since -1 and 1 are one direction; to each distance d comes
    exp(-gain (d + 1)), which tells near ones apart.

    Attributes:
        angles: numbers of the observation that are angles.
        distances: those that are distances.
        gain: of the nearness, per unit of the normalised distance.
    """

    angles: NDArray[np.int64]
    distances: NDArray[np.int64]
    gain: float

    def plain(self, n_obs: int) -> NDArray[np.int64]:
        """Numbers that are passed as they are."""
        return np.setdiff1d(np.arange(n_obs), self.angles)

    def size(self, n_obs: int) -> int:
        """How many features there are."""
        return n_obs + len(self.angles) + len(self.distances)

    def of(self, observations: Floats) -> Floats:
        """Features (N, size) of observations (N, n_obs)."""
        turn = np.float32(np.pi) * observations[:, self.angles]
        near = np.exp(-np.float32(self.gain) * (observations[:, self.distances] + np.float32(1.0)))
        plain = observations[:, self.plain(observations.shape[1])]
        return np.concatenate([plain, np.sin(turn), np.cos(turn), near], axis=1)


@dataclass(frozen=True)
class Network:
    """Layers of a policy, for one network shared by all boats (R = 1) or one per role (R = boats of a team).

    Attributes:
        weights: of each layer, (R, in, out) float32.
        biases: of each layer, (R, out) float32.
        features: what it is given.
        activation: between layers.
        kind: one of `KINDS`.
        interval: game steps for which a decision is held.
        n_obs: length of an observation.
        card: where it comes from, for people.
        carrying: the network that takes over in games where a boat of the team holds the flag; None: this one goes on.
        carriers: numbers of the observation that tell who of the team holds it; they are above 0 for who does.
    """

    weights: Sequence[Floats]
    biases: Sequence[Floats]
    features: Features
    activation: str
    kind: str
    interval: int
    n_obs: int
    card: Mapping[str, Any] = field(default_factory=dict)
    carrying: Network | None = None
    carriers: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    @property
    def preset(self) -> str:
        """Rules of the game it learned in; empty where its card does not say."""
        return preset_in(self.card)

    @property
    def roles(self) -> int:
        """Networks, one per role."""
        return int(self.weights[0].shape[0])

    def outputs(self, observations: Floats, roles: NDArray[np.int64]) -> Floats:
        """Last layer's values (N, out) for observations (N, n_obs) of boats with given places in their team (N,)."""
        seen = np.asarray(observations, np.float32)
        out = self._own(seen, roles)
        if self.carrying is not None and (held := self.held(seen)).any():
            out[held] = self.carrying.outputs(seen[held], roles[held])
        return out

    def held(self, observations: Floats) -> NDArray[np.bool_]:
        """(N,) whether a boat of the team holds the flag."""
        found: NDArray[np.bool_] = (observations[:, self.carriers] > 0.0).any(axis=1)
        return found

    def _own(self, observations: Floats, roles: NDArray[np.int64]) -> Floats:
        x = self.features.of(observations)
        if self.roles == 1:
            return self._through(x, 0)
        out = np.empty((len(x), self.biases[-1].shape[1]), np.float32)
        for role in range(self.roles):
            chosen = roles == role
            out[chosen] = self._through(x[chosen], role)
        return out

    def _through(self, x: Floats, role: int) -> Floats:
        act, last = ACTIVATIONS[self.activation], len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight[role] + bias[role]
            x = x if k == last else act(x)
        return x

    def commands(self, outputs: Floats, top_mps: NDArray[np.float64]) -> NDArray[np.float64]:
        """Speed m/s and relative heading deg (N, 2) that outputs ask for; the likeliest action, not a drawn one.

        Args:
            outputs: (N, out) of `outputs`.
            top_mps: (N,) top speeds, m/s.
        """
        if self.kind == "discrete":
            pairs = DISCRETE[np.argmax(outputs, axis=1)]
        else:
            action = np.clip(outputs.astype(np.float64), -1.0, 1.0)
            pairs = np.stack([0.5 * (action[:, 0] + 1.0), 180.0 * action[:, 1]], axis=1)
        return pairs * np.stack([top_mps, np.ones_like(top_mps)], axis=1)


def preset_in(card: Mapping[str, Any]) -> str:
    """Rules of the game that a card names; empty where it names none."""
    return str(card.get("preset", ""))[:40]
