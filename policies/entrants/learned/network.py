"""`Network`: a learned policy in numpy, from observations to actions, and its files; reading one runs no code."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.wrappers.actions import DISCRETE

from ..undertow.shape import NAMES

Floats = NDArray[np.float32]
ACTIVATIONS = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0)}
KINDS = {"discrete": 17, "normalised": 2, "raids": len(NAMES)}
"""Number of outputs by kind: action values; the mean of (speed, relative heading) scaled to [-1, 1]; the numbers of a
raid, see `raids`.
"""

FORMAT, VERSION, PAIR_VERSION = "steerclear-weights", 1, 2
"""Network pairs use the second version, so that readers of the first refuse them."""
TAKES_OVER = "carrying/"
MAX_BYTES = 64 * 2**20
"""Largest unpacked size of such a file, bytes."""
MOST_LAYERS, MOST_INTERVAL = 16, 1000
REMEDY = "give a file that steerclear export wrote"
UNREADABLE = (zipfile.BadZipFile, KeyError, ValueError, TypeError, OSError, EOFError, zlib.error, RuntimeError)


@dataclass(frozen=True)
class Features:
    """Inputs of a network, from an observation in [-1, 1].

    Angles a become sin(pi a) and cos(pi a), since -1 and 1 are one direction. Each distance d also gives exp(-gain (d +
    1)), which distinguishes near distances.

    Attributes:
        angles: numbers of the observation that are angles.
        distances: numbers of the observation that are distances.
        gain: of the nearness, per unit of the normalised distance.
    """

    angles: NDArray[np.int64]
    distances: NDArray[np.int64]
    gain: float

    def plain(self, n_obs: int) -> NDArray[np.int64]:
        """Return the numbers that are passed unchanged."""
        return np.setdiff1d(np.arange(n_obs), self.angles)

    def size(self, n_obs: int) -> int:
        """Return the number of features."""
        return n_obs + len(self.angles) + len(self.distances)

    def of(self, observations: Floats) -> Floats:
        """Return features (N, size) of observations (N, n_obs)."""
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
        features: its inputs.
        activation: between layers.
        kind: one of `KINDS`.
        interval: game steps for which a decision is held.
        n_obs: length of an observation.
        card: its origin, for people.
        carrying: network that takes over in games where a boat of the team holds the flag; None: this one always plays.
        carriers: numbers of the observation that are above 0 for boats of the team that hold the flag.
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
        """Rules of the game it learned in; empty if its card does not state them."""
        return preset_in(self.card)

    @property
    def roles(self) -> int:
        """Number of networks, one per role."""
        return int(self.weights[0].shape[0])

    def outputs(self, observations: Floats, roles: NDArray[np.int64]) -> Floats:
        """Return the last layer's values (N, out) for observations (N, n_obs) of boats in places (N,) of their team."""
        seen = np.asarray(observations, np.float32)
        out = self._own(seen, roles)
        if self.carrying is not None and (held := self.held(seen)).any():
            out[held] = self.carrying.outputs(seen[held], roles[held])
        return out

    def held(self, observations: Floats) -> NDArray[np.bool_]:
        """Return (N,) whether a boat of the team holds the flag."""
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
        """Return speed m/s and relative heading deg (N, 2) for outputs: the most likely action, not a drawn one.

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
    """Return the rules of the game that a card names; empty if it names none."""
    return str(card.get("preset", ""))[:40]


def write_weights(network: Network, path: Path) -> Path:
    """Write a network, completely or not at all."""
    with whole_file(path, PolicyError) as part, part.open("wb") as file:
        np.savez_compressed(file, **arrays_of(network))
    return path


def arrays_of(network: Network) -> dict[str, Any]:
    """Return a network's arrays by name, its card among them."""
    about = {
        "format": FORMAT,
        "version": VERSION if network.carrying is None else PAIR_VERSION,
        "activation": network.activation,
        "kind": network.kind,
        "interval": network.interval,
        "n_obs": network.n_obs,
        "layers": len(network.weights),
        "gain": network.features.gain,
        "card": dict(network.card),
    }
    layers: dict[str, Any] = {f"weight_{k}": value for k, value in enumerate(network.weights)}
    layers |= {f"bias_{k}": value for k, value in enumerate(network.biases)}
    layers |= {"angles": network.features.angles, "distances": network.features.distances}
    if network.carrying is not None:
        layers |= {f"{TAKES_OVER}{name}": value for name, value in arrays_of(network.carrying).items()}
        layers["carriers"] = network.carriers
    return {"about": np.array(json.dumps(about)), **layers}


def read_weights(path: str | Path) -> Network:
    """Read a network and check every array."""
    file = Path(path).expanduser()
    if not file.is_file():
        raise PolicyError(f"there are no weights at {file}; {REMEDY}")
    try:
        with zipfile.ZipFile(file) as archive:
            if (total := sum(member.file_size for member in archive.infolist())) > MAX_BYTES:
                raise ValueError(f"it unpacks to {total} bytes, more than {MAX_BYTES}")
        with np.load(file, allow_pickle=False) as found:
            return network_of({name: found[name] for name in found.files})
    except UNREADABLE as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise PolicyError(f"{file} holds no usable weights ({why}); {REMEDY}") from error


def network_of(arrays: dict[str, Any]) -> Network:
    """Build a network from its arrays."""
    about = json.loads(str(arrays["about"]))
    _check_about(about)
    layers = range(about["layers"])
    features = Features(arrays["angles"].astype(np.int64), arrays["distances"].astype(np.int64), float(about["gain"]))
    network = Network(
        weights=[_numbers(arrays[f"weight_{k}"], 3) for k in layers],
        biases=[_numbers(arrays[f"bias_{k}"], 2) for k in layers],
        features=features,
        activation=about["activation"],
        kind=about["kind"],
        interval=about["interval"],
        n_obs=about["n_obs"],
        card=about["card"],
    )
    _check_shapes(network)
    if about["version"] == VERSION:
        return network
    parts = {name.removeprefix(TAKES_OVER): array for name, array in arrays.items() if name.startswith(TAKES_OVER)}
    return joined(network, network_of(parts), arrays["carriers"].astype(np.int64))


def joined(first: Network, second: Network, carriers: Any) -> Network:
    """Join a network with one that takes over while a boat of the team holds the flag."""
    for name in ("n_obs", "kind", "interval"):
        if getattr(first, name) != getattr(second, name):
            raise ValueError(
                f"the network that takes over has {name} {getattr(second, name)}, not {getattr(first, name)}"
            )
    if first.carrying is not None or second.carrying is not None:
        raise ValueError("one of the two networks is a pair already")
    if carriers.ndim != 1 or not carriers.size or carriers.min() < 0 or carriers.max() >= first.n_obs:
        raise ValueError("carriers are no numbers of the observation")
    return replace(first, carrying=second, carriers=carriers)


def _check_about(about: Any) -> None:
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise ValueError("another kind of file")
    if about["version"] not in (VERSION, PAIR_VERSION):
        raise ValueError(f"format version {about['version']}, known are {VERSION} and {PAIR_VERSION}")
    if about["activation"] not in ACTIVATIONS or about["kind"] not in KINDS:
        raise ValueError(f"unknown activation {about['activation']!r} or kind {about['kind']!r}")
    for name, most in (("layers", MOST_LAYERS), ("interval", MOST_INTERVAL), ("n_obs", 100_000)):
        if type(about[name]) is not int or not 1 <= about[name] <= most:
            raise ValueError(f"{name} is {about[name]!r}")
    if not isinstance(about["card"], dict):
        raise ValueError("its card is none")


def _numbers(array: Any, axes: int) -> Any:
    if array.dtype != np.float32 or array.ndim != axes or not np.isfinite(array).all():
        raise ValueError("an array of weights is not finite float32, or has other axes")
    return array


def _check_shapes(network: Network) -> None:
    """Refuse layers that do not fit into one another."""
    size, roles = network.features.size(network.n_obs), network.roles
    for index in (network.features.angles, network.features.distances):
        if index.ndim != 1 or (index.size and not (index.min() >= 0 and index.max() < network.n_obs)):
            raise ValueError("features beyond the observation")
    for weight, bias in zip(network.weights, network.biases, strict=True):
        if weight.shape[:2] != (roles, size) or bias.shape != (roles, weight.shape[2]):
            raise ValueError(f"a layer has shape {weight.shape}, expected ({roles}, {size}, ...)")
        size = weight.shape[2]
    if size != KINDS[network.kind]:
        raise ValueError(f"{size} outputs are no {network.kind} actions")
