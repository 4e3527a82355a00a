"""The game among simulated boats as it truly stands: what scripted opponents know, and what the record holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.play.seat import Seat
from steerclear.policies.registry import ENTRIES
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .hull import STEP_S
from .orders import Bear

_SEEN = (L.X, L.Y, L.HEADING, L.SPEED)


class Game:
    """Rules and scripted players over boats that something else moves.

    Args:
        config: the game; its boats are blue first.
        players: scripted policy of each boat that has one, by number.
        seed: of the policies.

    Raises:
        ConfigError: a policy is not a scripted one.
    """

    def __init__(self, config: GameConfig, players: Mapping[int, str], seed: int) -> None:
        self.env = MctfEnv(config)
        self.core = self.env.core
        self.players = dict(players)
        self._seed = seed
        self._seats: list[Seat] = []
        for name in dict.fromkeys(players.values()):
            if name not in ENTRIES:
                raise ConfigError(f"simulated boats play scripted policies only, not {name!r}: {', '.join(ENTRIES)}")
            for team in (0, 1):
                boats = [i for i, other in players.items() if other == name and self.core.team[i] == team]
                if boats:
                    self._seats.append(Seat(policies.make(name), self.env, [config.agent_ids[i] for i in boats]))

    def start(self, states: Sequence[Array]) -> None:
        """Begin with the boats where they are, (N_STATE,) each."""
        rows = np.array(states)
        self.core.start_seen(rows[None, :, _SEEN])
        self.core.state[0] = rows
        for number, seat in enumerate(self._seats):
            seat.reset(self.env, 2 * self._seed + number)

    def orders(self) -> dict[int, Bear]:
        """What the scripted players' boats do next, driven home where the game does that."""
        if not self._seats:
            return {}
        wanted = np.zeros((1, self.core.n_boats, 2))
        for seat in self._seats:
            for agent_id, action in seat.act({}, {}).items():
                wanted[0, self.env.possible_agents.index(agent_id)] = action
        decided = self.core.commands(wanted)[0]
        return {i: Bear(float(decided[i, 1]), float(decided[i, 0])) for i in self.players}

    def follow(self, states: Sequence[Array]) -> None:
        """The boats have moved by one step: apply the rules."""
        rows = np.array(states)
        self.core.follow(rows[None, :, _SEEN], STEP_S)
        self.core.state[0] = rows  # with the autopilots' memory, which the rules do not need and the oracle does
