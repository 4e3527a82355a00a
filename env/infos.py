"""Infos of a step: raw observations and the global state as dicts with Pyquaticus' keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L

from .arrays import Games, Rules
from .config import GameConfig
from .core import BatchedMctf
from .observation_layout import Key, bounds_of, name_of, sight_of_line
from .observe import observe_raw, see_obstacles

BOOLEAN_ENTRIES = frozenset(
    {"has_flag", "on_side", "oob", "is_tagged", "is_disabled", "blue_flag_pickup", "red_flag_pickup"}
)


class InfoWriter:
    """Writes the ``infos`` of game 0 of ``core``."""

    def __init__(self, core: BatchedMctf) -> None:
        self._core = core
        low, high = core.observation_low, core.observation_high
        self.observation = VectorNormalizer(core.observation_keys, [1] * core.n_obs, low, high)
        keys = global_state_keys(core.config)
        low, high = bounds_of(keys, core.config, core.field, float(core.max_speed_mps.max()))
        sizes = [2 if name_of(key).endswith(("pos", "flag_home")) else 1 for key in keys]
        self.global_state = VectorNormalizer(keys, sizes, low, high)
        self._observation_booleans = [k for k, key in enumerate(core.observation_keys) if _is_boolean(key)]
        self._global_booleans = [key for key in keys if _is_boolean(key)]
        self._raw = np.zeros((1, core.n_boats, core.n_obs))
        self._global = np.zeros(len(low))

    def raw_observations(self) -> Array:
        """Return raw observations (n, n_obs); the array is reused."""
        observe_raw(self._core.rules, self._core.games, self._raw, 0, 1)
        return self._raw[0]

    def global_vector(self) -> Array:
        """Return the raw global state (n_global,); the array is reused."""
        describe_game(self._core.rules, self._core.games, 0, self._global)
        return self._global

    def infos(self) -> dict[str, dict[str, Any]]:
        """Return infos by agent id; all agents share one global state dict."""
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
    return name_of(key) in BOOLEAN_ENTRIES


class VectorNormalizer:
    """Order, sizes and bounds of a vector's entries. Methods have the names that Pyquaticus' policies call.

    Args:
        keys: names of the entries, in order.
        sizes: how many numbers each entry has.
        low: (n,) lower bounds.
        high: (n,) upper bounds.

    Attributes:
        is_angle: (n,) bool, which numbers are angles in deg; their two bounds are the same direction.
    """

    def __init__(self, keys: Sequence[Key], sizes: Sequence[int], low: Array, high: Array) -> None:
        self.keys, self.sizes = tuple(keys), tuple(sizes)
        self.low, self.high = low, high
        self.flattened_length = len(low)
        self._ends = np.cumsum(self.sizes).tolist()
        self.is_angle = np.repeat([name_of(key).endswith(("bearing", "heading")) for key in self.keys], self.sizes)
        self.normalized_space = Box(-1.0, 1.0, (len(low),), np.float32)
        self.unnormalized_space = Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    def flattened(self, entries: Mapping[Key, Any]) -> np.ndarray:
        """Return the raw vector (n,) float32 of a dict with every entry."""
        missing = [key for key in self.keys if key not in entries]
        if missing:
            raise GameError(f"entries are missing: {missing[:5]}; give all {len(self.keys)}")
        return np.concatenate([np.ravel(entries[key]) for key in self.keys]).astype(np.float32)

    def normalized(self, entries: Mapping[Key, Any]) -> np.ndarray:
        """Return the vector (n,) float32 in [-1, 1] of a dict with every entry."""
        raw = self.flattened(entries).astype(np.float64)
        half = 0.5 * (self.high - self.low)
        return np.clip((raw - 0.5 * (self.high + self.low)) / half, -1.0, 1.0).astype(np.float32)

    def unnormalized(self, vector: Any) -> dict[Key, Any]:
        """Return the entries of a normalised vector (n,); single numbers as floats, positions as (2,) arrays."""
        values = np.asarray(vector, dtype=np.float64)
        if values.shape != self.low.shape:
            raise GameError(f"the vector has shape {values.shape}; give {self.low.shape}")
        return self.named(0.5 * (self.high - self.low) * values + 0.5 * (self.high + self.low))

    def named(self, raw: Array) -> dict[Key, Any]:
        """Return the entries of a raw vector (n,)."""
        values = raw.tolist()
        return {
            key: values[end - 1] if size == 1 else np.array(raw[end - size : end])
            for key, size, end in zip(self.keys, self.sizes, self._ends, strict=True)
        }


N_BOAT = 11
"""Numbers per boat, without ``is_disabled`` (where shown) and obstacles."""

SCRIMMAGE = 4
"""Number of the dividing line among the sight lines."""

BOAT_ENTRIES = (
    "pos",
    "heading",
    "scrimmage_line_bearing",
    "scrimmage_line_distance",
    "speed",
    "has_flag",
    "on_side",
    "oob",
    "tagging_cooldown",
    "is_tagged",
)
FLAG_ENTRIES = ("blue_flag_home", "red_flag_home", "blue_flag_pos", "red_flag_pos")
TEAM_ENTRIES = ("blue_flag_pickup", "red_flag_pickup", "blue_team_score", "red_team_score")


def global_state_keys(config: GameConfig) -> tuple[Key, ...]:
    """Return the names of the global state's entries, in order; positions have two numbers."""
    keys: list[Key] = []
    for agent_id in config.agent_ids:
        keys += [(agent_id, entry) for entry in BOAT_ENTRIES]
        keys += [(agent_id, "is_disabled")] if config.shows_disabled else []
        for k in range(config.n_obstacles):
            keys += [(agent_id, f"obstacle_{k}_distance"), (agent_id, f"obstacle_{k}_bearing")]
    return (*keys, *FLAG_ENTRIES, *TEAM_ENTRIES)


@lean_kernel
def _describe_boat(rules: Rules, games: Games, b: int, i: int, out: Array) -> None:
    state = games.state[b, i]
    x, y, heading = state[L.X], state[L.Y], state[L.HEADING]
    out[0] = x
    out[1] = y
    out[2] = heading
    out[3], out[4] = sight_of_line(x, y, heading, rules.sight_lines[0], SCRIMMAGE)
    out[5] = state[L.SPEED]
    out[6] = games.has_flag[b, i]
    out[7] = games.on_side[b, i]
    out[8] = games.oob[b, i]
    out[9] = games.tagging_cooldown_s[b, i]
    out[10] = games.is_tagged[b, i]
    at = N_BOAT
    if rules.shows_disabled:
        out[at] = games.is_disabled[b, i]
        at += 1
    see_obstacles(rules, games.state[b], i, out, at)


@lean_kernel
def describe_game(rules: Rules, games: Games, b: int, out: Array) -> None:
    """Write the raw global state of game ``b`` into ``out`` (n_global,)."""
    width = N_BOAT + int(rules.shows_disabled) + 2 * rules.obstacles.bounds.shape[0]
    for i in range(rules.n_boats):
        _describe_boat(rules, games, b, i, out[i * width : (i + 1) * width])
    at = rules.n_boats * width
    for team in range(2):
        for axis in range(2):
            out[at + 2 * team + axis] = rules.flag_home[team, axis]
            out[at + 4 + 2 * team + axis] = games.flag_position[b, team, axis]
        out[at + 8 + team] = games.flag_taken[b, team]
        out[at + 10 + team] = games.captures[b, team]
