"""A network that learns only what to do while the flag is held; another plays until then.

Richley-NIWC-ATL's second part: who reaches the flag is one skill, who brings it home another.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.weights_file import joined, read_weights
from steerclear.shield.exceptions import ConfigError

from .settings import TrainingSettings

FIRST = "first"
"""The option that names the weights that play until the flag is held."""
ONE_OF_TWO = "give weights of a single network, such as play/final.npz of a training by qmix+ppo"


def first_of(settings: TrainingSettings, core: Any) -> Network | None:
    """The network that plays until the flag is held; None where the learner plays all the time.

    Raises:
        ConfigError: it is of other observations, decisions or actions, or an option is unknown.
    """
    for name in settings.options:
        if name != FIRST:
            raise ConfigError(f"unknown option {name!r} of ppo; it knows {FIRST}: FILE of weights")
    if FIRST not in settings.options:
        return None
    network = read_weights(str(settings.options[FIRST]))
    if network.carrying is not None:
        raise ConfigError(f"{FIRST}: {settings.options[FIRST]} holds two networks, and one plays first; {ONE_OF_TWO}")
    wanted = {"n_obs": core.n_obs, "interval": settings.interval, "kind": "discrete"}
    for name, value in wanted.items():
        if getattr(network, name) != value or settings.actions != "discrete":
            raise ConfigError(
                f"{FIRST}: {settings.options[FIRST]} has another {name} than the games, which need {value}"
            )
    return network


def carriers_of(core: Any) -> np.ndarray:
    """Numbers of an observation that tell who of the own team holds the flag."""
    keys = [key if isinstance(key, str) else "/".join(key) for key in core.observation_keys]
    wanted = [k for k, key in enumerate(keys) if key.endswith("has_flag") and not key.startswith("opponent")]
    return np.array(wanted, np.int64)


def pair_of(first: Network, second: Network, core: Any) -> Network:
    """Both as one."""
    return joined(first, second, carriers_of(core))


class FirstPart:
    """A step of the games in which decisions are the first network's where nobody of the team holds the flag.

    What the learner chose there changes nothing, so that what it learns from it is zero on average.

    Args:
        batch: the games.
        network: the first network.
    """

    def __init__(self, batch: Any, network: Network) -> None:
        self._step, self._batch, self._network = batch.step, batch, network
        self._carriers = carriers_of(batch.core)
        self._roles = np.tile(np.arange(len(batch.boats)), batch.core.n_games)

    def __call__(self, actions: Any, *more: Any) -> Any:
        """Step."""
        core, boats = self._batch.core, self._batch.boats
        seen = core.observations[:, boats].reshape(self._batch.learners, -1)
        free = ~(seen[:, self._carriers] > 0.0).any(axis=1)
        own = np.array(actions)
        if free.any():
            own[free] = np.argmax(self._network.outputs(seen[free], self._roles[free]), axis=1)
        return self._step(own, *more)
