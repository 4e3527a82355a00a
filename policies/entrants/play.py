"""`EntrantTeam`: base of all entrants; an entrant decides its boats' orders from an `Observation`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError

from ..scripted.team import boat_numbers, game_core
from .observation import Observation, is_turned, look
from .plane import Order, wrap


class EntrantTeam(ABC):
    """A `TeamPolicy` that sees the live game in its own-end frame.

    Subclasses define `decide`, and `begin` if they have a memory.

    Attributes:
        name: for records and reports.
        seed: of the game, set before `begin`.
        dt_s: time between decisions, s.
    """

    name = "entrant"

    def __init__(self) -> None:
        self._ids: list[str] = []
        self.seed = 0
        self.dt_s = 0.1

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            PolicyError: not an `MctfEnv` (or a wrapper around one), or the boats are not one whole team.
        """
        self.core = game_core(env)
        boats = boat_numbers(self.core, agent_ids)
        if len(boats) != self.core.config.team_size:
            raise PolicyError(f"entrant {self.name!r} plays whole teams; give all of its boats, got {list(agent_ids)}")
        self._ids, self.team = sorted(agent_ids, key=self.core.config.agent_ids.index), int(self.core.team[boats[0]])
        self._turn = math.pi if is_turned(self.core, self.team) else 0.0
        self.seed, self.dt_s = seed, self.core.config.decision_s
        self.begin(look(self.core, self.team))

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
        """Return actions (speed m/s, relative heading deg) of the boats; the arguments are not read.

        Raises:
            PolicyError: `reset` was not called.
        """
        if not self._ids:
            raise PolicyError(f"entrant {self.name!r} has no game; call reset(env, agent_ids, seed) first")
        obs = look(self.core, self.team)
        orders = self.decide(obs)
        return {
            agent_id: (speed, math.degrees(wrap(heading - boat.heading)))
            for agent_id, boat, (speed, heading) in zip(self._ids, obs.own, orders, strict=True)
        }

    def begin(self, obs: Observation) -> None:  # noqa: B027 (most entrants remember nothing)
        """Begin a game, given the view of its start."""

    @abstractmethod
    def decide(self, obs: Observation) -> list[Order]:
        """Return an order for each own boat."""


class BatchFront(EntrantTeam):
    """A thin layer over the batch policy in ``_batch``, which subclasses set."""

    _batch: Any

    def begin(self, obs: Observation) -> None:
        """Begin the batch of one game."""
        self._batch.reset(self.core, self.team, self.seed)

    def decide(self, obs: Observation) -> list[Order]:
        """Return the commands of the batch policy."""
        commands = self._batch.act(self.core, self.team)[0].tolist()
        return [
            (speed, boat.heading + math.radians(turn)) for boat, (speed, turn) in zip(obs.own, commands, strict=True)
        ]
