"""Random numbers of each game: one 64-bit state per game, so that a game never depends on its neighbours."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import lean_kernel

GAMMA = np.uint64(0x9E3779B97F4A7C15)
"""Step of the SplitMix64 generator's state."""

MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
MIX_2 = np.uint64(0x94D049BB133111EB)


def seed_states(seed: int | None, n_games: int) -> np.ndarray:
    """Return the first random states of ``n_games`` games, uint64; game 0 equals a single game of the same seed."""
    return np.random.SeedSequence(seed).generate_state(n_games, dtype=np.uint64)


@lean_kernel
def mix(word: np.uint64) -> np.uint64:
    """Apply SplitMix64's output function: every bit of the result depends on every bit of ``word``."""
    word = (word ^ (word >> np.uint64(30))) * MIX_1
    word = (word ^ (word >> np.uint64(27))) * MIX_2
    return word ^ (word >> np.uint64(31))


@lean_kernel
def next_uniform(rng: np.ndarray, b: int) -> float:
    """Draw the next number of stream ``b`` (of a game, or a boat) in [0, 1), by SplitMix64; advance its state."""
    rng[b] += GAMMA
    return np.float64(mix(rng[b]) >> np.uint64(11)) * (1.0 / 9007199254740992.0)
