"""Who never got to the goal: a livelock of team-mates is safe, and nobody stands still in it."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array

from .play import Film


def never_arrived(film: Film, bare: Film) -> Array:
    """Share of own boats that had not reached their first goal by the end, and did without a guard.

    A boat that cannot get there in time even alone says nothing about the guard: it counts as one that arrived.

    Args:
        film: what was played with a guard.
        bare: the same scenes without.

    Returns:
        (B,) in [0, 1].
    """
    own = film.scenes.own
    lost = np.isnan(film.first_goal_s[:, own]) & ~np.isnan(bare.first_goal_s[:, own])
    return np.asarray(lost.mean(axis=1))
