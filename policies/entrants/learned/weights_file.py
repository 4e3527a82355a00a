"""Files of weights: numpy arrays and a card in an ``.npz``; reading one runs no code."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import PolicyError

from .network import ACTIVATIONS, KINDS, Features, Network

FORMAT, VERSION, PAIR_VERSION = "steerclear-weights", 1, 2
"""A network with one that takes over is of the second version, which readers of the first refuse."""
TAKES_OVER = "carrying/"
MAX_BYTES = 64 * 2**20
"""Largest unpacked size of such a file, bytes."""
MOST_LAYERS, MOST_INTERVAL = 16, 1000
REMEDY = "give a file that steerclear export wrote"
UNREADABLE = (zipfile.BadZipFile, KeyError, ValueError, TypeError, OSError, EOFError, zlib.error, RuntimeError)


def write_weights(network: Network, path: Path) -> Path:
    """Write a network, whole or not at all.

    Raises:
        PolicyError: the file cannot be written.
    """
    with whole_file(path, PolicyError) as part, part.open("wb") as file:
        np.savez_compressed(file, **arrays_of(network))
    return path


def arrays_of(network: Network) -> dict[str, Any]:
    """A network's arrays by name, its card among them."""
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
    layers = {f"weight_{k}": value for k, value in enumerate(network.weights)}
    layers |= {f"bias_{k}": value for k, value in enumerate(network.biases)}
    looks = {"angles": network.features.angles, "distances": network.features.distances}
    return {"about": np.array(json.dumps(about)), **looks, **layers, **_arrays_of_second(network)}


def _arrays_of_second(network: Network) -> dict[str, Any]:
    if network.carrying is None:
        return {}
    second = {f"{TAKES_OVER}{name}": value for name, value in arrays_of(network.carrying).items()}
    return {"carriers": network.carriers, **second}


def read_weights(path: str | Path) -> Network:
    """Read a network and check every array.

    Raises:
        PolicyError: there is no such file, it is cut short, too large, or none of ours.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        raise PolicyError(f"there are no weights at {file}; {REMEDY}")
    try:
        _check_size(file)
        with np.load(file, allow_pickle=False) as found:
            return network_of({name: found[name] for name in found.files})
    except UNREADABLE as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise PolicyError(f"{file} holds no usable weights ({why}); {REMEDY}") from error


def _check_size(file: Path) -> None:
    with zipfile.ZipFile(file) as archive:
        total = sum(member.file_size for member in archive.infolist())
    if total > MAX_BYTES:
        raise ValueError(f"it unpacks to {total} bytes, more than {MAX_BYTES}")


def network_of(arrays: dict[str, Any]) -> Network:
    """The network that arrays are.

    Raises:
        ValueError: they are none; KeyError: one is missing.
    """
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
    return network if about["version"] == VERSION else _with_second(network, arrays)


def _with_second(network: Network, arrays: dict[str, Any]) -> Network:
    parts = {name.removeprefix(TAKES_OVER): array for name, array in arrays.items() if name.startswith(TAKES_OVER)}
    return joined(network, network_of(parts), arrays["carriers"].astype(np.int64))


def joined(first: Network, second: Network, carriers: Any) -> Network:
    """A network, and one that takes over where a boat of the team holds the flag.

    Raises:
        ValueError: they are of different games or decisions, or either is such a pair already.
    """
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
