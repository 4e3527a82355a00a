"""`ScriptedTeam`: scripted play as a `TeamPolicy` in one `MctfEnv`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.env.core import BatchedMctf
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.wrappers.actions import check_boats

from .batch import ScriptedBatch
from .layout import Behaviour
from .plan import Plan


class BatchTeam:
    """A batch policy for some boats of a team in one game; the game plays exactly as one of a batch.

    Args:
        batch: the policy; its ``reset`` accepts boat numbers.
    """

    def __init__(self, batch: Any) -> None:
        self.name, self._batch = batch.name, batch
        self._ids: list[str] = []

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            PolicyError: not an `MctfEnv` (or a wrapper around one), unknown boats, boats of both teams, or a game that
                the batch policy does not play.
        """
        self._core = game_core(env)
        self._boats = boat_numbers(self._core, agent_ids)
        self._ids = list(agent_ids)
        self._team = int(self._core.team[self._boats[0]])
        self._batch.reset(self._core, self._team, seed, self._boats)

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
        """Return actions (speed m/s, relative heading deg) of the boats; `infos` are not read.

        Raises:
            PolicyError: `reset` was not called.
        """
        if not self._ids:
            raise PolicyError(f"policy {self.name!r} has no game; call reset(env, agent_ids, seed) first")
        rows = self._rows(observations).tolist()
        return {agent_id: (row[0], row[1]) for agent_id, row in zip(self._ids, rows, strict=True)}

    def _rows(self, observations: Mapping[str, np.ndarray]) -> Array:
        """Return commands (n, 2) from the live game; the observations are not read."""
        found: Array = self._batch.act(self._core, self._team)[0]
        return found


class ScriptedTeam(BatchTeam):
    """A scripted team in one game, a thin layer over `ScriptedBatch` with the same arguments."""

    def __init__(self, name: str, plan: Plan) -> None:
        super().__init__(ScriptedBatch(name, plan))

    @property
    def behaviours(self) -> dict[str, Behaviour]:
        """Behaviour of each boat in this game."""
        return dict(zip(self._ids, self._batch.behaviours[0], strict=True))

    @property
    def waypoints_reached(self) -> dict[str, int]:
        """Waypoints reached so far, by boat; zero for boats without waypoints."""
        return dict(zip(self._ids, self._batch.waypoints_reached[0].tolist(), strict=True))


def game_core(env: Any) -> BatchedMctf:
    """Return the game behind an `MctfEnv` or a wrapper around one."""
    core = getattr(getattr(env, "unwrapped", env), "core", None)
    if not isinstance(core, BatchedMctf) or core.n_games != 1:
        raise PolicyError(f"scripted policies need an MctfEnv, not {type(env).__name__}; use make_batch for batches")
    return core


def boat_numbers(core: BatchedMctf, agent_ids: Sequence[str]) -> IntArray:
    """Return the numbers of boats of one team."""
    known = core.config.agent_ids
    check_boats(agent_ids, known)
    boats = np.array([known.index(agent_id) for agent_id in agent_ids], dtype=np.int64)
    if np.unique(core.team[boats]).size != 1:
        raise PolicyError(f"agent_ids {list(agent_ids)} are of both teams; one policy plays one team")
    return boats
