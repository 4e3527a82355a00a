"""The game on the water: settings and static constraints of a fleet file, and `Umpire`, which applies the rules."""

from __future__ import annotations

import math
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from steerclear.env.arrays import CAPTURE
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.bridge.feed import BoatStatus, FlagStatus, GameState
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Contact
from steerclear.shield.exceptions import ConfigError, FleetFileError, GameError
from steerclear.shield.jit import IntArray
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER, Surroundings
from steerclear.shield.wrappers.mctf import surroundings_of

FROM_FILE = {
    "team_size": "boats",
    "env_bounds_m": "field.size_m",
    "platforms": "boats.platform",
    "dt_s": "rate_hz",
}
"""Settings of the game that other keys of a fleet file say."""
CARRY_S = 1.0
"""A boat's last fix is carried forward along its heading by this time at most, s."""
SIDES = ("blue", "red")


def game_config(fleet: FleetFile) -> GameConfig:
    """Settings of the game a fleet plays: the preset's, with the file's field, boats, rate and ``rules``.

    Raises:
        FleetFileError: no boat has an agent, the preset or a rule is unknown, or a rule contradicts another key.
    """
    players = [boat for boat in fleet.boats if boat.agent is not None]
    if not players:
        raise FleetFileError("no boat plays; give boats an agent: agent_0, agent_1, ..., blue first")
    return _config(fleet, tuple(fleet.platform_of[boat.name] for boat in players))


def stand_in_config(fleet: FleetFile, boats: Sequence[str]) -> GameConfig:
    """Settings of a game for boats that play none: they are one team, and nobody is the other.

    Args:
        fleet: the file.
        boats: names of the boats.

    Raises:
        FleetFileError: the preset or a rule is unknown, or a rule contradicts another key.
    """
    return _config(fleet, 2 * tuple(fleet.platform_of[name] for name in boats))


def _config(fleet: FleetFile, platforms: tuple[Platform, ...]) -> GameConfig:
    for rule, key in FROM_FILE.items():
        if rule in fleet.rules:
            raise FleetFileError(f"rules.{rule} is what {key} says; leave it out")
    for rule in fleet.rules:
        if rule not in GameConfig.names():
            near = get_close_matches(rule, GameConfig.names(), 1)
            hint = f"did you mean {near[0]!r}?" if near else f"known settings: {', '.join(GameConfig.names())}"
            raise FleetFileError(f"rules: unknown game setting {rule!r}; {hint}")
    given: dict[str, Any] = {
        "team_size": len(platforms) // 2,
        "env_bounds_m": tuple(fleet.field.size_m),
        "platforms": platforms,
        "dt_s": fleet.dt_s,
    }
    try:
        return GameConfig.preset(fleet.preset, **given, **fleet.rules)
    except (ConfigError, GameError) as error:
        raise FleetFileError(f"preset and rules: {error}") from None


def player_names(fleet: FleetFile) -> tuple[str, ...]:
    """Names of the boats that play, in the order of their agents."""
    return tuple(boat.name for boat in fleet.boats if boat.agent is not None)


class Umpire:
    """Watches the boats of one game and applies the rules; moves nothing.

    The rules are those of `BatchedMctf.follow`. The game begins when every boat has been heard of; from then on a boat
    not heard of for ``lost_after_s`` counts as out of bounds until it is heard of again.

    Args:
        config: settings of the game.
        names: the boats' names, in the order of their agents.
        lost_after_s: s.

    Raises:
        GameError: there are not as many names as boats.
    """

    def __init__(self, config: GameConfig, names: Sequence[str], lost_after_s: float = 5.0) -> None:
        if len(names) != config.n_boats:
            raise GameError(f"{len(names)} names for {config.n_boats} boats; name each boat of the game")
        _warm_up(config)
        self.core = BatchedMctf(config)
        self.names = tuple(names)
        self.lost_after_s = lost_after_s
        self.began = False
        self.events: tuple[str, ...] = ()
        """What happened at the last look, a line each."""
        self._at_s = -math.inf

    @property
    def over(self) -> bool:
        """Whether the game has ended."""
        return bool(self.core.terminated[0] or self.core.truncated[0])

    def watch(self, contacts: Sequence[Contact], now_s: float) -> GameState:
        """Look at the boats and say how the game stands; after its end it stands as it ended.

        Args:
            contacts: the latest contact of each boat heard of; others are not looked at.
            now_s: time now, s, on the clock of the contacts.
        """
        known = {contact.boat: contact for contact in contacts}
        waiting = [name for name in self.names if name not in known]
        seen = np.array([self._seen(known.get(name), now_s) for name in self.names])
        self.events = ()
        note = ""
        if not self.began:
            if waiting or np.isnan(seen).any():
                return self.state(f"waiting for {', '.join(waiting) or 'boats that are lost'}")
            self.core.start_seen(seen[np.newaxis])
            self.began = True
            self.events = ("the game begins",)
        elif not self.over:
            before = self.core.view()
            self.core.follow(seen[np.newaxis], max(0.0, now_s - self._at_s))
            self.events = tuple(self._told(before))
            lost = [name for name, row in zip(self.names, seen, strict=True) if np.isnan(row[0])]
            note = f"lost, so out of bounds: {', '.join(lost)}" if lost else ""
        self._at_s = now_s
        return self.state(note)

    def _seen(self, contact: Contact | None, now_s: float) -> tuple[float, float, float, float]:
        """X m, y m, heading deg, speed m/s of a boat now; NaN when it is lost."""
        if contact is None or now_s - contact.fixed_s > self.lost_after_s:
            return (math.nan,) * 4
        ahead_m = contact.speed_mps * min(max(0.0, now_s - contact.fixed_s), CARRY_S)
        x_m = contact.position_m[0] + ahead_m * math.sin(contact.heading_rad)
        y_m = contact.position_m[1] + ahead_m * math.cos(contact.heading_rad)
        return x_m, y_m, math.degrees(contact.heading_rad), contact.speed_mps

    def state(self, note: str = "") -> GameState:
        """How the game stands, as of the last look."""
        if self.began:
            self.core.commands(np.zeros((1, len(self.names), 2)))  # tells which boats the game drives
        return state_of(self.core, self.names, note)

    def _told(self, before: Any) -> list[str]:
        core, names = self.core, self.names
        told = []
        for i, name in enumerate(names):
            if core.made_tag[0, i] >= 0:
                told.append(f"{name} tags {names[core.made_tag[0, i]]}")
            if core.has_flag[0, i] and not before.has_flag[i]:
                told.append(f"{name} grabs the flag")
            if core.oob[0, i] and not before.oob[i]:
                told.append(f"{name} is out of bounds")
            if before.is_tagged[i] and not core.is_tagged[0, i]:
                told.append(f"{name} is free again")
        for team in (0, 1):
            if core.events[0, team, CAPTURE]:
                told.append(f"{SIDES[team]} captures the flag: {core.captures[0, 0]} : {core.captures[0, 1]}")
        if self.over:
            told.append("the game is over")
        return told


def _warm_up(config: GameConfig) -> None:
    """Compile the rules, so that the game's first seconds are not spent on it."""
    core = BatchedMctf(config)
    seen = core.state[..., : L.SPEED + 1].copy()
    core.start_seen(seen)
    core.follow(seen, config.dt_s)
    core.commands(np.zeros((1, config.n_boats, 2)))


def state_of(core: BatchedMctf, names: Sequence[str], note: str = "") -> GameState:
    """The state of a running game (number 0 of ``core``) under the boats' names."""
    boats = {
        name: BoatStatus(
            tagged=bool(core.is_tagged[0, i]),
            has_flag=bool(core.has_flag[0, i]),
            oob=bool(core.oob[0, i]),
            on_side=bool(core.on_side[0, i]),
            cooldown_s=float(core.tagging_cooldown_s[0, i]),
            driven=bool(core.driven[0, i]),
        )
        for i, name in enumerate(names)
    }
    return GameState(
        time_s=float(core.time_s[0]),
        boats=boats,
        flags=(_flag(core, 0), _flag(core, 1)),
        captures=_pair(core.captures),
        grabs=_pair(core.grabs),
        tags=_pair(core.tags),
        over=bool(core.terminated[0] or core.truncated[0]),
        note=note,
    )


def _flag(core: BatchedMctf, team: int) -> FlagStatus:
    x_m, y_m = core.flag_position[0, team].tolist()
    return FlagStatus(x_m, y_m, bool(core.flag_taken[0, team]))


def _pair(counts: IntArray) -> tuple[int, int]:
    return int(counts[0, 0]), int(counts[0, 1])


def game_obstacles(fleet: FleetFile) -> Surroundings:
    """Obstacles of the game, and the circle of our own flag at home as ``stops``; nothing when no boat plays.

    Raises:
        FleetFileError: the preset or a rule is unknown, or a rule contradicts another key.
    """
    if not fleet.agent_ids:
        return OPEN_WATER
    return surroundings_of(BatchedMctf(game_config(fleet)), fleet.team_number)
