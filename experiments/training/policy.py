"""The torch side of a policy: features, a network per role, and the ways to numpy and back."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from steerclear.policies.entrants.learned.network import Features, Network
from steerclear.policies.entrants.learned.sb3_file import network_of_tensors
from torch import nn

ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
NEAR_M = 10.0
"""Distances below about this are told apart by the features' nearness, m."""


def features_of(core: Any, wanted: bool) -> Features:
    """What a network is given of the observations of some games."""
    names = [key if isinstance(key, str) else key[1] for key in core.observation_keys]
    angles = [k for k, name in enumerate(names) if name.endswith(("bearing", "heading"))]
    distances = [k for k, name in enumerate(names) if name.endswith("distance")]
    longest_m = float(np.max(core.observation_high[distances]))
    if not wanted:
        return Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)
    return Features(np.array(angles), np.array(distances), 0.5 * longest_m / NEAR_M)


class TeamFeatures(BaseFeaturesExtractor):
    """`Features` in torch; of an observation with a place in the team behind it, that place is passed on.

    Args:
        space: of the observations.
        features: what to make of them.
        n_obs: length of an observation, without the place.
        interval: game steps for which decisions are held; kept with the weights.
        places: boats of a team, where one network is given their places; 0: each has its own, or none is told.
    """

    def __init__(self, space: Any, features: Features, n_obs: int, interval: int, places: int = 0) -> None:
        self._n_obs = n_obs
        super().__init__(space, features.size(n_obs) + space.shape[0] - n_obs)
        for name, values in (
            ("angles", features.angles),
            ("distances", features.distances),
            ("plain", features.plain(n_obs)),
            ("interval", np.array(interval)),
            ("places", np.array(places)),
        ):
            self.register_buffer(name, torch.as_tensor(values))
        self.register_buffer("gain", torch.tensor(features.gain, dtype=torch.float32))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features (..., size) of observations (..., n)."""
        seen, place = observations[..., : self._n_obs], observations[..., self._n_obs :]
        turn = np.float32(np.pi) * seen[..., self.angles]
        near = torch.exp(-self.gain * (seen[..., self.distances] + 1.0))
        return torch.cat([seen[..., self.plain], torch.sin(turn), torch.cos(turn), near, place], dim=-1)


class RoleExtractor(nn.Module):
    """A network per role, of actor and critic: only the own role's part is not zero, so that heads are its own too.

    Args:
        size: features without the place.
        roles: number of roles R.
        hidden: widths.
        activation: class.
    """

    def __init__(self, size: int, roles: int, hidden: tuple[int, ...], activation: Any) -> None:
        super().__init__()
        self.size, self.count, self.act = size, roles, activation()
        self.latent_dim_pi = self.latent_dim_vf = roles * hidden[-1] + roles
        self.register_buffer("roles", torch.tensor(roles))
        widths = (size, *hidden)
        for who in ("policy", "value"):
            pairs = list(pairwise(widths))
            weights = nn.ParameterList([nn.Parameter(_orthogonal(roles, one, two)) for one, two in pairs])
            biases = nn.ParameterList([nn.Parameter(torch.zeros(roles, two)) for _, two in pairs])
            setattr(self, f"{who}_weights", weights)
            setattr(self, f"{who}_biases", biases)

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Latents of actor and critic."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Latent (N, R * width + R) of the actor."""
        return self._through(features, self.policy_weights, self.policy_biases)

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Latent of the critic."""
        return self._through(features, self.value_weights, self.value_biases)

    def _through(self, features: torch.Tensor, weights: Any, biases: Any) -> torch.Tensor:
        place = features[:, self.size :]
        x = features[:, : self.size].expand(self.count, -1, -1)
        for weight, bias in zip(weights, biases, strict=True):
            x = self.act(torch.baddbmm(bias[:, None], x, weight))
        own = x * place.T[:, :, None]
        return torch.cat([own.permute(1, 0, 2).reshape(len(features), -1), place], dim=1)


def _orthogonal(roles: int, one: int, two: int) -> torch.Tensor:
    parts = [nn.init.orthogonal_(torch.empty(two, one), 2.0**0.5).T for _ in range(roles)]
    return torch.stack(parts).contiguous()


class BoatPolicy(ActorCriticPolicy):
    """SB3's actor and critic with a network per role.

    Args:
        roles: number of roles; 1 is SB3's own network.
    """

    def __init__(self, *args: Any, roles: int = 1, **kwargs: Any) -> None:
        self._roles = roles
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        if self._roles == 1:
            super()._build_mlp_extractor()
            return
        hidden = tuple(self.net_arch["pi"] if isinstance(self.net_arch, dict) else self.net_arch)
        size = self.features_dim - self._roles
        self.mlp_extractor = RoleExtractor(size, self._roles, hidden, self.activation_fn).to(self.device)


def numbers_of(network: nn.Module) -> tuple[list[Any], list[Any]]:
    """Weights (1, in, out) and biases (1, out) of a plain network's layers, as they are now, in numpy."""
    linear = [layer for layer in network.modules() if isinstance(layer, nn.Linear)]
    weights = [np.ascontiguousarray(layer.weight.detach().cpu().numpy().T[None]) for layer in linear]
    return weights, [layer.bias.detach().cpu().numpy()[None].copy() for layer in linear]


def network_of(policy: Any, activation: str, card: dict[str, Any]) -> Network:
    """The actor of a policy in numpy, as it is now: no memory is shared with what learns on."""
    tensors = {name: value.detach().cpu().numpy().copy() for name, value in policy.state_dict().items()}
    return network_of_tensors(tensors, activation, None, card)


def load_actor(policy: Any, network: Network) -> None:
    """Put the weights of a network for all boats, of the same shape, into a policy's actor."""
    values = policy.state_dict()
    names = [name for name in values if name.startswith("mlp_extractor.policy_net")]
    keys = sorted({name.rsplit(".", 1)[0] for name in names}, key=lambda name: int(name.rsplit(".", 1)[1]))
    given = _one_network(network, int(values["features_extractor.places"]))
    wanted = [tuple(values[f"{key}.weight"].shape[::-1]) for key in (*keys, "action_net")]
    if (found := [weight.shape for weight, _ in given]) != wanted:
        raise ValueError(f"layers of shapes {found}, wanted {wanted}")
    for key, (weight, bias) in zip((*keys, "action_net"), given, strict=True):
        values[f"{key}.weight"].copy_(torch.as_tensor(weight.T))
        values[f"{key}.bias"].copy_(torch.as_tensor(bias))


def _one_network(network: Network, places: int) -> list[tuple[Any, Any]]:
    """Weights (in, out) and bias (out,) of each layer; places, where told, are the first layer's last inputs."""
    shared = [(w, b) for w, b in zip(network.weights, network.biases, strict=True)]
    same = all((w == w[:1]).all() and (k == 0 or (b == b[:1]).all()) for k, (w, b) in enumerate(shared))
    if network.roles not in (1, places) or not same:
        raise ValueError(
            f"it has {network.roles} networks, or one that is told places, and start takes one; give net.roles: placed "
            "if it is told places, or leave start out"
        )
    first_w, first_b = shared[0]
    if places:
        rows = np.broadcast_to(first_b, (places, first_b.shape[1]))
        first = np.concatenate([first_w[0], rows]), np.zeros_like(first_b[0])
    else:
        first = first_w[0], first_b[0]
    return [first, *((w[0], b[0]) for w, b in shared[1:])]
