"""Protocols of policies: an object that plays all boats of a team, in one game or in a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from steerclear.shield.jit import Array, BoolArray

Action = Any
"""A discrete action (int), a pair (speed m/s, relative heading deg) or the name of a field point."""


@runtime_checkable
class TeamPolicy(Protocol):
    """Plays some boats of one game. Deterministic: the same seed and game give the same actions."""

    name: str

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game; call it after ``env.reset``.

        Args:
            env: the game's `MctfEnv`, or a wrapper around it.
            agent_ids: the boats to play, all of one team.
            seed: seed of everything that the policy draws.
        """

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, Action]:
        """Return the actions of the policy's boats, from the latest observations and infos of all boats."""


@runtime_checkable
class BatchPolicy(Protocol):
    """Plays one team in every game of a `BatchedMctf`. Game b of a batch plays as a `TeamPolicy` with seed + b."""

    name: str

    def reset(self, core: Any, team: int, seed: int) -> None:
        """Begin all games.

        Args:
            core: the `BatchedMctf`.
            team: 0 blue, 1 red.
            seed: game b draws from seed + b.
        """

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew, game b with seed + b; the others go on."""

    def act(self, core: Any, team: int) -> Array:
        """Return commands (B, n_team, 2), speed m/s and relative heading deg; the next call reuses the array."""
