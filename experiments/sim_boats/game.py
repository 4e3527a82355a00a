"""The true game among simulated boats: players, starts and scripted opponents."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.play.policy_runner import PolicyRunner
from steerclear.experiments.play.spec import opening
from steerclear.policies.registry import ENTRIES
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .hull import STEP_S, Bear
from .settings import SimBoat

Place = tuple[float, float, float]  # x m, y m, heading deg
_SEEN = (L.X, L.Y, L.HEADING, L.SPEED)


def playing(boats: Sequence[SimBoat]) -> list[int]:
    """Return the numbers of the playing boats, blue first; empty if the teams differ in size."""
    blue, red = ([i for i, boat in enumerate(boats) if boat.team == team] for team in (0, 1))
    return [*blue, *red] if len(blue) == len(red) else []


def game_of(boats: Sequence[SimBoat], preset: str | GameConfig, rules: Mapping[str, Any]) -> GameConfig | None:
    """Return the game these boats play, from a preset or as given; None if the teams differ in size.

    Raises:
        ConfigError: the preset or a rule is unknown, or a boat has a policy but no game.
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
    """Return each boat's start: its own, else the game's fixed one for that team size, or a random one.

    Args:
        boats: all boats.
        config: the game the boats play, if any.
        random_seed: draw starts with distance between them, from this seed; None: the fixed ones.

    Raises:
        ConfigError: there is no room for random starts, or a boat outside the teams has no start of its own.
    """
    largest = max(1, *(sum(boat.team == team for boat in boats) for team in (0, 1)))
    game = config or GameConfig.preset("aamas2024", team_size=largest)
    if random_seed is None:
        rows = BatchedMctf(game.replace(default_start=True)).state[0][:, [L.X, L.Y, L.HEADING]]
    else:
        start = opening(game, random_seed)
        rows = np.column_stack([start["agent_position"], start["agent_heading"]])
    free = iter(rows[: game.team_size].tolist()), iter(rows[game.team_size :].tolist())
    places = []
    for boat in boats:
        own = next(free[boat.team], None) if boat.team in (0, 1) else None  # used up even if the boat has its own start
        x_m, y_m, heading_deg = boat.start or own or (math.nan,) * 3
        if math.isnan(x_m):
            raise ConfigError(f"boat {boat.name!r} is in no team; give it a start (x m, y m, heading deg)")
        places.append((x_m, y_m, heading_deg))
    return places


class Game:
    """Rules and scripted players (number to policy, else `ConfigError`) for boats moved elsewhere, blue first."""

    def __init__(self, config: GameConfig, players: Mapping[int, str], seed: int) -> None:
        self.env, self.players, self._seed = MctfEnv(config), dict(players), seed
        self.core = self.env.core
        self._runners: list[PolicyRunner] = []
        for name in dict.fromkeys(players.values()):
            if name not in ENTRIES:
                raise ConfigError(f"simulated boats play scripted policies only, not {name!r}: {', '.join(ENTRIES)}")
            for team in (0, 1):
                ids = [config.agent_ids[i] for i in players if players[i] == name and self.core.team[i] == team]
                if ids:
                    self._runners.append(PolicyRunner(policies.make(name), self.env, ids))

    def start(self, states: Array) -> None:
        """Begin with the boats' current states (n, N_STATE)."""
        self.core.start_seen(states[None, :, _SEEN])
        self.core.state[0] = states
        for number, runner in enumerate(self._runners):
            runner.reset(self.env, 2 * self._seed + number)

    def orders(self) -> dict[int, Bear]:
        """Return the next orders of the scripted players' boats; the game itself steers tagged boats and the like."""
        if not self._runners:
            return {}
        nominal = np.zeros((1, self.core.n_boats, 2))
        for runner in self._runners:
            for agent_id, action in runner.act({}, {}).items():
                nominal[0, self.env.possible_agents.index(agent_id)] = action
        decided = self.core.commands(nominal)[0]
        return {i: Bear(float(decided[i, 1]), float(decided[i, 0])) for i in self.players}

    def follow(self, states: Array) -> None:
        """Apply the rules after the boats have moved by one step."""
        self.core.follow(states[None, :, _SEEN], STEP_S)
        self.core.state[0] = states  # with controller memory, which the avoidability analysis needs
