"""A network as a team, in every game of a batch or in one game."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.env.angles import wrap_bearing
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L

from ...scripted.team import BatchTeam
from .network import Network

DISABLED = "is_disabled"
"""Key of a boat in a power play, in observations."""
_SEED_MASK = (1 << 64) - 1


class LearnedBatch:
    """A `BatchPolicy` that plays a network. Each decision is held for the network's interval, as a steered course.

    Args:
        network: the network.
        name: name for records and reports.
        sample: draw actions with the network's probabilities instead of taking the most likely (discrete ones only).

    Raises:
        PolicyError: sampling from a network without probabilities.
    """

    def __init__(self, network: Network, name: str = "weights", sample: bool = False) -> None:
        if sample and network.kind != "discrete":
            raise PolicyError(f"policy {name!r} has no probabilities to draw actions with; leave out sample")
        self.network, self.name, self.sample = network, name, sample
        self._team = -1

    def reset(self, core: Any, team: int, seed: int, boats: Any = None) -> None:
        """Begin all games, as `ScriptedBatch.reset`."""
        own = np.flatnonzero(core.team == team)
        self._team, self._boats = team, own if boats is None else np.asarray(boats, np.int64)
        self._roles = np.searchsorted(own, self._boats)
        self._seen = self._known(core)
        self._check(core.n_obs if self._seen is None else self._seen.size, own.size)
        shape = (core.n_games, self._boats.size)
        self._top_mps = core.max_speed_mps[self._boats]
        self._left = np.zeros(core.n_games, np.int64)
        self._speed_mps, self._heading_deg = np.zeros(shape), np.zeros(shape)
        self._out = np.zeros((*shape, 2))
        self._streams = np.zeros(core.n_games, np.uint64)
        self._drawn = np.zeros(core.n_games, np.int64)
        self.restart(np.ones(core.n_games, np.bool_), seed)

    def _known(self, core: Any) -> Any:
        """Return the numbers of an observation without is_disabled.

        None if the network's and the game's observations have equal length, or do not fit at all.
        """
        if core.n_obs == self.network.n_obs:
            return None
        last = [key if isinstance(key, str) else key[1] for key in core.observation_keys]
        known = np.array([k for k, name in enumerate(last) if name != DISABLED], np.int64)
        return known if known.size == self.network.n_obs else None

    def _check(self, n_obs: int, team_size: int) -> None:
        net = self.network
        if n_obs != net.n_obs:
            raise PolicyError(
                f"policy {self.name!r} takes observations of {net.n_obs} numbers, this game makes {n_obs}; "
                f"play it in the game it learned in ({_game_words(net.preset)})"
            )
        if net.roles not in (1, team_size):
            raise PolicyError(f"policy {self.name!r} has {net.roles} roles, the team has {team_size} boats")

    def restart(self, chosen: BoolArray, seed: int) -> None:
        """Begin the chosen games (B,) anew."""
        self._left[chosen] = 0
        self._drawn[chosen] = 0
        for game in np.flatnonzero(chosen):
            self._streams[game] = (int(seed) + int(game)) & _SEED_MASK

    def act(self, core: Any, team: int) -> Array:
        """Return commands (B, n_team, 2), speed m/s and relative heading deg; the next call reuses the array."""
        if team != self._team or core.n_games != self._out.shape[0]:
            raise PolicyError(f"policy {self.name!r} was not reset for team {team} of these games; call reset first")
        return self.answer(core.observations[:, self._boats], core.state[:, self._boats, L.HEADING])

    def answer(self, observations: Any, heading_deg: Array) -> Array:
        """Return commands for observations (B, n_team, n_obs) and headings (B, n_team), deg."""
        due = np.flatnonzero(self._left == 0)
        self._out[..., 1] = (self._heading_deg - heading_deg + 180.0) % 360.0 - 180.0
        if due.size:  # a new turn is passed unchanged, as in training: 180 and -180 deg differ
            self._out[due, :, 1] = self._decide(due, observations[due], heading_deg[due])
        self._left -= 1
        self._out[..., 0] = self._speed_mps
        return self._out

    def _decide(self, due: Any, observations: Any, heading_deg: Array) -> Any:
        """Choose actions for the games that are due; return the turns (due, n_team), deg."""
        games, boats = heading_deg.shape
        observations = observations if self._seen is None else observations[..., self._seen]
        outputs = self.network.outputs(observations.reshape(games * boats, -1), np.tile(self._roles, games))
        if self.sample:
            outputs = outputs + self._gumbel(due, boats, outputs.shape[1])
        commands = self.network.commands(outputs, np.tile(self._top_mps, games)).reshape(games, boats, 2)
        self._speed_mps[due] = commands[..., 0]
        self._heading_deg[due] = heading_deg + commands[..., 1]
        self._left[due] = self.network.interval
        return commands[..., 1]

    def _gumbel(self, due: Any, boats: int, actions: int) -> Any:
        """Return noise whose argmax with logits is a draw by their probabilities; each game has its own numbers."""
        rows = []
        for game in due:
            rng = np.random.default_rng([int(self._streams[game]), int(self._drawn[game])])
            rows.append(rng.gumbel(size=(boats, actions)).astype(np.float32))
            self._drawn[game] += 1
        return np.concatenate(rows)


def _game_words(preset: str) -> str:
    """Return how to request the game in which a network learned."""
    return f"--preset {preset}, with its team_size and obstacles" if preset else "preset, team_size, obstacles"


class LearnedTeam(BatchTeam):
    """The same in one game: a layer over `LearnedBatch` with the same arguments.

    It plays from the observations that it receives, not from the live game.
    """

    def __init__(self, network: Network, name: str = "weights", sample: bool = False) -> None:
        super().__init__(LearnedBatch(network, name, sample))

    def _rows(self, observations: Mapping[str, np.ndarray]) -> Array:
        seen = np.stack([observations[agent_id] for agent_id in self._ids])[None]
        rows = self._batch.answer(seen, self._core.state[:, self._boats, L.HEADING])[0]
        return np.array([(speed, wrap_bearing(float(turn))) for speed, turn in rows])
