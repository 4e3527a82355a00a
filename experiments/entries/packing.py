"""Observations and infos of a step, packed small: keys travel once a game, then only values.

Pickled by us, read by the entry's process; never the other way round.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError

Packed = tuple[Any, ...]


class Packer:
    """Packs steps of one game.

    Args:
        with_infos: whether raw observations and the global state are wanted, too.
    """

    def __init__(self, with_infos: bool = True) -> None:
        self._with_infos = with_infos
        self._keys: list[Any] | None = None

    def pack(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Packed:
        """A step: agents, their observations (n, n_obs), keys (None: as before), values of the dicts.

        Raises:
            PolicyError: infos lack what the policy is entitled to.
        """
        agents = list(observations)
        rows = [np.asarray(observations[agent_id]) for agent_id in agents]
        if not self._with_infos:
            return agents, rows, None, None
        try:
            dicts = [infos[agent_id]["unnorm_obs"] for agent_id in agents]
            dicts.append(next(iter(infos.values()))["global_state"])
        except (KeyError, StopIteration, TypeError) as error:
            raise PolicyError(f"infos lack {error} for a submission; pass those of MctfEnv.reset or step") from error
        keys: list[Any] | None = [list(one) for one in dicts]
        if keys == self._keys:
            keys = None
        else:
            self._keys = keys
        return agents, rows, keys, [list(one.values()) for one in dicts]


class Unpacker:
    """Unpacks what a `Packer` packed, in the same order."""

    def __init__(self) -> None:
        self._keys: list[Any] = []

    def unpack(self, packed: Packed) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Observations and infos of a step."""
        agents, rows, keys, values = packed
        observations = dict(zip(agents, rows, strict=True))
        if values is None:
            return observations, {}
        self._keys = self._keys if keys is None else keys
        *raw, state = [dict(zip(names, one, strict=True)) for names, one in zip(self._keys, values, strict=True)]
        infos = {agent: {"unnorm_obs": one, "global_state": state} for agent, one in zip(agents, raw, strict=True)}
        return observations, infos
