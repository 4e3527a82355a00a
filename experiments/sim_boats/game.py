"""The game among simulated boats as it truly stands: who plays it, where they start, what scripted opponents do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.play.openings import opening
from steerclear.experiments.play.policy_runner import PolicyRunner
from steerclear.policies.registry import ENTRIES
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .hull import STEP_S, Bear
from .settings import SimBoat

Place = tuple[float, float, float]
"""x m, y m, heading deg."""
_BLUE, _RED = 0, 1


def playing(boats: Sequence[SimBoat]) -> list[int]:
    """Numbers of the boats that play, blue first; none when the teams are not of one size."""
    blue = [i for i, boat in enumerate(boats) if boat.team == _BLUE]
    red = [i for i, boat in enumerate(boats) if boat.team == _RED]
    return [*blue, *red] if len(blue) == len(red) else []


def game_of(boats: Sequence[SimBoat], preset: str | GameConfig, rules: Mapping[str, Any]) -> GameConfig | None:
    """The game these boats play, by a preset or as given; None when the teams are not of one size.

    Raises:
        ConfigError: the preset or a rule is unknown, or a boat has a policy and no game to play it in.
    """
    players = playing(boats)
    stray = [boat.name for i, boat in enumerate(boats) if boat.policy and i not in players]
    if stray:
        raise ConfigError(
            f"boat {stray[0]!r} has a policy and no game: give as many red boats as blue ones, or no policy"
        )
    if not players:
        return None
    settings = {**rules, "team_size": len(players) // 2, "platforms": tuple(boats[i].platform for i in players)}
    return preset.replace(**settings) if isinstance(preset, GameConfig) else GameConfig.preset(preset, **settings)


def start_places(boats: Sequence[SimBoat], config: GameConfig | None, random_seed: int | None) -> list[Place]:
    """Start of each boat: its own place, else the game's fixed one for teams of that size, or a random one.

    Args:
        boats: all boats.
        config: the game the boats play, if any.
        random_seed: draw places apart from each other, from this seed; None: the fixed ones.

    Raises:
        ConfigError: there is no room for random places, or a boat outside the game has no place of its own.
    """
    largest = max(1, *(sum(boat.team == team for boat in boats) for team in (_BLUE, _RED)))
    game = config or GameConfig.preset("aamas2024", team_size=largest)
    free = _fixed(game) if random_seed is None else _random(game, random_seed)
    waiting = {_BLUE: free[: game.team_size], _RED: free[game.team_size :]}
    return [_next(waiting, boat) for boat in boats]


def _next(waiting: dict[int, list[Place]], boat: SimBoat) -> Place:
    places = waiting.get(boat.team, [])
    place = places.pop(0) if places else None
    if boat.start is None and place is None:
        raise ConfigError(f"boat {boat.name!r} is in no team; give it a start (x m, y m, heading deg)")
    return boat.start or place  # type: ignore[return-value]  # one of them is there


def _fixed(game: GameConfig) -> list[Place]:
    core = BatchedMctf(game.replace(default_start=True))
    return [(float(row[L.X]), float(row[L.Y]), float(row[L.HEADING])) for row in core.state[0]]


def _random(game: GameConfig, seed: int) -> list[Place]:
    start = opening(game, seed)
    pairs = zip(start["agent_position"], start["agent_heading"], strict=True)
    return [(float(x), float(y), float(heading)) for (x, y), heading in pairs]


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
        self._seats: list[PolicyRunner] = []
        for name in dict.fromkeys(players.values()):
            if name not in ENTRIES:
                raise ConfigError(f"simulated boats play scripted policies only, not {name!r}: {', '.join(ENTRIES)}")
            for team in (0, 1):
                boats = [i for i, other in players.items() if other == name and self.core.team[i] == team]
                if boats:
                    ids = [config.agent_ids[i] for i in boats]
                    self._seats.append(PolicyRunner(policies.make(name), self.env, ids))

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
