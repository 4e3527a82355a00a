"""Infos of a step: raw observations and the global state as dicts, keyed as Pyquaticus keys them."""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear.shield.jit import Array

from .core import BatchedMctf
from .global_state import describe_game, entry_size, global_state_bounds, global_state_keys
from .normalizer import VectorNormalizer
from .observation_layout import Key
from .observe import observe_raw

BOOLEAN_ENTRIES = frozenset(
    {"has_flag", "on_side", "oob", "is_tagged", "is_disabled", "blue_flag_pickup", "red_flag_pickup"}
)


class InfoWriter:
    """Writes ``infos`` of a single game.

    Args:
        core: the games; game 0 is described.
    """

    def __init__(self, core: BatchedMctf) -> None:
        self._core = core
        config, field = core.config, core.field
        top_speed = float(core.max_speed_mps.max())
        low, high = core.observation_low, core.observation_high
        self.observation = VectorNormalizer(core.observation_keys, [1] * core.n_obs, low, high)
        keys = global_state_keys(config)
        low, high = global_state_bounds(config, field, top_speed)
        self.global_state = VectorNormalizer(keys, [entry_size(key) for key in keys], low, high)
        self._observation_booleans = [k for k, key in enumerate(core.observation_keys) if _is_boolean(key)]
        self._global_booleans = [key for key in keys if _is_boolean(key)]
        self._raw = np.zeros((1, core.n_boats, core.n_obs))
        self._global = np.zeros(len(low))

    def raw_observations(self) -> Array:
        """Raw observations (n, n_obs); the array is reused."""
        observe_raw(self._core.rules, self._core.games, self._raw, 0, 1)
        return self._raw[0]

    def global_vector(self) -> Array:
        """Raw global state (n_global,); the array is reused."""
        describe_game(self._core.rules, self._core.games, 0, self._global)
        return self._global

    def infos(self) -> dict[str, dict[str, Any]]:
        """Infos by agent id; all agents share one global state dict."""
        state = self.global_state.named(self.global_vector())
        for key in self._global_booleans:
            state[key] = state[key] != 0.0
        infos: dict[str, dict[str, Any]] = {}
        keys = self._core.observation_keys
        for agent_id, row in zip(self._core.config.agent_ids, self.raw_observations().tolist(), strict=True):
            for k in self._observation_booleans:
                row[k] = row[k] != 0.0
            infos[agent_id] = {"global_state": state, "unnorm_obs": dict(zip(keys, row, strict=True))}
        return infos


def _is_boolean(key: Key) -> bool:
    return (key if isinstance(key, str) else key[1]) in BOOLEAN_ENTRIES
