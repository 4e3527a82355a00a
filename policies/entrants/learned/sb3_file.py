"""Reading of a Stable-Baselines3 zip as a `Network`: only its tensors are read, never its pickles."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.extras import install_command

from ...sb3 import CARD, UNREADABLE, algorithm_of, read_card, saved_settings
from .network import Features, Network

PLAYABLE = ("PPO", "A2C")
ABOUT = "steerclear."
"""Prefix of our own tensors in a model."""
TAKES_OVER = "takes_over"
"""Entry of the card: the model plays only while the flag is held; another network plays until then."""
REMEDY = "give a PPO or A2C zip with an MlpPolicy, or one of steerclear train"


def read_sb3(path: str | Path, interval: int | None = None) -> Network:
    """Return the actor of a saved model.

    Args:
        path: the zip.
        interval: game steps for which a decision is held; None: as in training.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        raise PolicyError(f"there is no model at {file}; give the zip that model.save wrote")
    saved = saved_settings(file)
    if (algorithm := algorithm_of(saved)) not in PLAYABLE:
        raise PolicyError(f"{file} is a model of {algorithm}, whose actor is another kind of network; {REMEDY}")
    card = read_card(file)
    check_whole(file, card)
    try:
        return network_of_tensors(_tensors(file), _activation(saved), interval, {**card, "source": file.name})
    except (*UNREADABLE, TypeError, IndexError) as error:
        why = " ".join(str(error).split())[:160]
        raise PolicyError(f"{file} has no actor this can play ({type(error).__name__}: {why}); {REMEDY}") from error


def add_card(file: Path | io.BytesIO, card: Mapping[str, Any]) -> None:
    """Add a card to a model's zip, such as the preset it learned in."""
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr(CARD, json.dumps(dict(card)))


def check_whole(file: Path, card: Mapping[str, Any]) -> None:
    """Refuse a model that is only one of two networks that play together."""
    if card.get(TAKES_OVER):
        raise PolicyError(
            f"{file} holds one network of two, the one that takes over while the flag is held; give final.npz or "
            "best.npz of its training, which hold both (to play: weights:FINAL.npz)"
        )


def _tensors(file: Path) -> dict[str, Any]:
    try:
        import torch
    except ImportError as error:
        raise PolicyError(f"sb3 models need the extra: {install_command('train')}") from error
    import pickle

    with zipfile.ZipFile(file) as archive:
        content = io.BytesIO(archive.read("policy.pth"))
    try:
        found = torch.load(content, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        raise ValueError("it holds more than tensors") from error
    return {name: value.numpy() for name, value in found.items()}


def _activation(saved: Mapping[str, Any]) -> str:
    """Return the activation's name, from the text beside the pickled settings; SB3's default if there is none."""
    words = str(saved.get("policy_kwargs", {}).get("activation_fn", "Tanh"))
    if "ReLU" in words:
        return "relu"
    if "Tanh" in words:
        return "tanh"
    raise ValueError(f"its activation {words[:60]} is not known here")


def network_of_tensors(
    tensors: Mapping[str, Any], activation: str, interval: int | None, card: Mapping[str, Any]
) -> Network:
    """Return the actor from a policy's tensors, under SB3's names."""
    numbers = {name: np.asarray(value) for name, value in tensors.items()}
    head_w, head_b = numbers["action_net.weight"], numbers["action_net.bias"]
    own = "features_extractor.angles" in numbers
    weights, biases = _role_layers(numbers) if "mlp_extractor.roles" in numbers else _plain_layers(numbers)
    roles, width = weights[-1].shape[0] if weights else 1, weights[-1].shape[2] if weights else head_w.shape[1]
    blocks = [head_w[:, r * width : (r + 1) * width].T for r in range(roles)]
    offsets = [head_b + (head_w[:, roles * width + r] if roles > 1 else 0.0) for r in range(roles)]
    weights, biases = [*weights, np.stack(blocks)], [*biases, np.stack(offsets)]
    features = _features(numbers) if own else Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)
    if places := int(numbers.get("features_extractor.places", 0)):
        weights, biases = _placed(weights, biases, places)
    extra = len(features.angles) + len(features.distances)
    held = int(numbers["features_extractor.interval"]) if own else 1
    return Network(
        weights=[np.ascontiguousarray(w, np.float32) for w in weights],
        biases=[np.ascontiguousarray(b, np.float32) for b in biases],
        features=features,
        activation=activation,
        kind="normalised" if "log_std" in numbers else "discrete",
        interval=held if interval is None else interval,
        n_obs=weights[0].shape[1] - extra,
        card=card,
    )


def _placed(weights: list[Any], biases: list[Any], places: int) -> tuple[list[Any], list[Any]]:
    """Turn a network with one-hot input of the boat's place into one network per place.

    The first layer's last rows become biases.
    """
    first = weights[0][0]
    weights = [np.repeat(w, places, axis=0) for w in (first[None, :-places], *weights[1:])]
    return weights, [biases[0] + first[-places:], *(np.repeat(b, places, axis=0) for b in biases[1:])]


def _features(numbers: Mapping[str, Any]) -> Features:
    at = "features_extractor."
    return Features(numbers[f"{at}angles"], numbers[f"{at}distances"], float(numbers[f"{at}gain"]))


def _plain_layers(numbers: Mapping[str, Any]) -> tuple[list[Any], list[Any]]:
    """Return the hidden layers of SB3's own extractor, (1, in, out) and (1, out)."""
    pattern = re.compile(r"mlp_extractor\.policy_net\.(\d+)\.weight")
    order = sorted(int(m.group(1)) for m in map(pattern.fullmatch, numbers) if m)
    at = [f"mlp_extractor.policy_net.{k}" for k in order]
    return [numbers[f"{k}.weight"].T[None] for k in at], [numbers[f"{k}.bias"][None] for k in at]


def _role_layers(numbers: Mapping[str, Any]) -> tuple[list[Any], list[Any]]:
    """Return the hidden layers of a network per role, (R, in, out) and (R, out)."""
    count = sum(bool(re.fullmatch(r"mlp_extractor\.policy_weights\.\d+", name)) for name in numbers)
    at = "mlp_extractor.policy_"
    return [numbers[f"{at}weights.{k}"] for k in range(count)], [numbers[f"{at}biases.{k}"] for k in range(count)]
