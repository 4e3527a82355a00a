"""Named vectors: between a dict of entries, a raw vector, and one normalised to [-1, 1]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array

from .observation_layout import Key


class VectorNormalizer:
    """Order, sizes and bounds of a vector's entries. Methods are named as Pyquaticus' policies call them.

    Args:
        keys: names of the entries, in order.
        sizes: how many numbers each takes.
        low: (n,) lower bounds.
        high: (n,) upper bounds.

    ``is_angle`` (n,) tells which numbers are angles in deg: there, both bounds are one direction.
    """

    def __init__(self, keys: Sequence[Key], sizes: Sequence[int], low: Array, high: Array) -> None:
        self.keys = tuple(keys)
        self.sizes = tuple(sizes)
        self.low = low
        self.high = high
        starts = np.cumsum([0, *self.sizes])
        self._spans = {key: (int(starts[k]), int(starts[k + 1])) for k, key in enumerate(self.keys)}
        self.is_angle = np.repeat([_is_angle(key) for key in self.keys], self.sizes)
        self.normalized_space = Box(-1.0, 1.0, (len(low),), np.float32)
        self.unnormalized_space = Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    @property
    def flattened_length(self) -> int:
        """Numbers in the vector."""
        return len(self.low)

    def flattened(self, entries: Mapping[Key, Any]) -> np.ndarray:
        """Raw vector (n,) float32 of a dict with every entry.

        Raises:
            GameError: an entry is missing.
        """
        missing = [key for key in self.keys if key not in entries]
        if missing:
            raise GameError(f"entries are missing: {missing[:5]}; give all {len(self.keys)}")
        return np.concatenate([np.ravel(entries[key]) for key in self.keys]).astype(np.float32)

    def normalized(self, entries: Mapping[Key, Any]) -> np.ndarray:
        """Vector (n,) float32 in [-1, 1] of a dict with every entry.

        Raises:
            GameError: an entry is missing.
        """
        raw = self.flattened(entries).astype(np.float64)
        half = 0.5 * (self.high - self.low)
        return np.clip((raw - 0.5 * (self.high + self.low)) / half, -1.0, 1.0).astype(np.float32)

    def unnormalized(self, vector: Any) -> dict[Key, Any]:
        """Entries of a normalised vector (n,); entries of one number as floats, positions as (2,) arrays.

        Raises:
            GameError: the vector has another length.
        """
        values = np.asarray(vector, dtype=np.float64)
        if values.shape != self.low.shape:
            raise GameError(f"the vector has shape {values.shape}; give {self.low.shape}")
        raw = 0.5 * (self.high - self.low) * values + 0.5 * (self.high + self.low)
        return self.named(raw)

    def named(self, raw: Array) -> dict[Key, Any]:
        """Entries of a raw vector (n,)."""
        values = raw.tolist()
        return {
            key: values[start] if stop - start == 1 else np.array(raw[start:stop])
            for key, (start, stop) in self._spans.items()
        }


def _is_angle(key: Key) -> bool:
    return (key if isinstance(key, str) else key[1]).endswith(("bearing", "heading"))
