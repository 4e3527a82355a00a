"""Counting breaches: a pair of boats whose centres come within a radius of each other.

A breach is counted once per entry, per pair: the pair is inside after this step and was not after the one
before. The start position itself is not counted, so a pair that starts inside counts at the first step, as
in the reference simulator. Distances are sampled once per step (0.1 s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from steerclear.shield.exceptions import ConfigError


@dataclass(frozen=True)
class PairDistances:
    """Distances of every pair of boats after every step.

    Attributes:
        pairs: (p, 2) int64, the two boats, smaller index first.
        distance_m: (T, p), after steps 1..T.
    """

    pairs: NDArray[np.int64]
    distance_m: NDArray[np.float64]

    @classmethod
    def of(cls, position: ArrayLike) -> PairDistances:
        """Measure a track.

        Args:
            position: (T+1, n, 2) m, index 0 is the start.

        Raises:
            ConfigError: another shape, or a position that is not finite.
        """
        track = np.asarray(position, dtype=np.float64)
        if track.ndim != 3 or track.shape[2] != 2 or track.shape[0] < 1:
            raise ConfigError(f"a track has shape (steps + 1, boats, 2); got {track.shape}")
        if not np.isfinite(track).all():
            raise ConfigError("a track holds positions that are not finite; check the recorder or the file")
        first, second = np.triu_indices(track.shape[1], k=1)
        gap = track[1:, first] - track[1:, second]
        return cls(np.column_stack([first, second]).astype(np.int64), np.hypot(gap[..., 0], gap[..., 1]))

    def of_pairs(self, chosen: NDArray[np.bool_]) -> PairDistances:
        """Keep the pairs where ``chosen`` (p,) is true."""
        return PairDistances(self.pairs[chosen], self.distance_m[:, chosen])

    def closest_m(self) -> float:
        """Return the smallest distance, m; infinity where there is no pair or no step."""
        return float(self.distance_m.min(initial=np.inf))


def entries(distances: PairDistances, radius_m: ArrayLike) -> NDArray[np.bool_]:
    """Mark the steps at which a pair enters the radius.

    Args:
        distances: T steps, p pairs.
        radius_m: one radius or one per pair; two boats at exactly this distance are inside.

    Returns:
        (T, p), row t for step t + 1.

    Raises:
        ConfigError: a radius that is not positive.
    """
    if not (np.asarray(radius_m) > 0.0).all():
        raise ConfigError(f"the separation radius must be positive, in metres; got {radius_m}")
    inside = distances.distance_m <= radius_m
    before = np.zeros_like(inside)
    before[1:] = inside[:-1]
    return inside & ~before


def count_breaches(distances: PairDistances, radius_m: ArrayLike) -> int:
    """Count the entries of all pairs into the radius (m, one or one per pair)."""
    return int(entries(distances, radius_m).sum())


def team_pairs(team: ArrayLike, side: int, kind: str) -> NDArray[np.bool_]:
    """Choose a team's pairs, in the order of `PairDistances.of`.

    Args:
        team: (n,) team number of each boat.
        side: the team in question.
        kind: "teammate" (both boats its own) or "opponent" (exactly one is).

    Raises:
        ConfigError: another kind.
    """
    own = np.asarray(team, dtype=np.int64) == side
    first, second = np.triu_indices(len(own), k=1)
    if kind == "teammate":
        return own[first] & own[second]
    if kind == "opponent":
        return own[first] != own[second]
    raise ConfigError(f"unknown kind of pair {kind!r}; choose teammate or opponent")
