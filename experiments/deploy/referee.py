"""The game's rules for boats moved elsewhere: `Umpire` applies them, `Referee` receives positions and publishes."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from steerclear.env.arrays import CAPTURE
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.feed import FeedReceiver
from steerclear.shield.bridge.feed_packets import BoatStatus, FeedSender, FlagStatus, GameState
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Closing, Contact
from steerclear.shield.bridge.session import key_of
from steerclear.shield.exceptions import ConfigError, FleetFileError, GameError
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
"""Game settings that other keys of a fleet file give."""
CARRY_S = 1.0  # longest time for which a boat's last fix is extrapolated along its heading, s
SIDES = ("blue", "red")


def game_config(fleet: FleetFile) -> GameConfig:
    """Return the settings of a fleet's game: the preset's, with the file's field, boats, rate and ``rules``.

    Raises:
        FleetFileError: no boat has an agent, the preset or a rule is unknown, or a rule contradicts another key.
    """
    players = player_names(fleet)
    if not players:
        raise FleetFileError("no boat plays; give boats an agent: agent_0, agent_1, ..., blue first")
    return _config(fleet, tuple(fleet.platform_of[name] for name in players))


def stand_in_config(fleet: FleetFile, boats: Sequence[str]) -> GameConfig:
    """Return settings as `game_config` for boats that play no game: they are one team; the other has no boats."""
    return _config(fleet, 2 * tuple(fleet.platform_of[name] for name in boats))


def _config(fleet: FleetFile, platforms: tuple[Platform, ...]) -> GameConfig:
    known = GameConfig.names()
    for rule in fleet.rules:
        if rule in FROM_FILE:
            raise FleetFileError(f"rules.{rule} is what {FROM_FILE[rule]} says; leave it out")
        if rule not in known:
            near = get_close_matches(rule, known, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"known settings: {', '.join(known)}"
            raise FleetFileError(f"rules: unknown game setting {rule!r}; {hint}")
    values = (len(platforms) // 2, tuple(fleet.field.size_m), platforms, fleet.dt_s)
    given: dict[str, Any] = dict(zip(FROM_FILE, values, strict=True))
    try:
        return GameConfig.preset(fleet.preset, **given, **fleet.rules)
    except (ConfigError, GameError) as error:
        raise FleetFileError(f"preset and rules: {error}") from None


def player_names(fleet: FleetFile) -> tuple[str, ...]:
    """Return the names of the boats that play, in the order of their agents."""
    return tuple(boat.name for boat in fleet.boats if boat.agent is not None)


def game_obstacles(fleet: FleetFile) -> Surroundings:
    """Return the game's obstacles, with the circle around the own flag's home as ``stops``; empty if no boat plays.

    Raises:
        FleetFileError: the preset or a rule is unknown, or a rule contradicts another key.
    """
    if not fleet.agent_ids:
        return OPEN_WATER
    return surroundings_of(BatchedMctf(game_config(fleet)), fleet.team_number)


class Umpire:
    """Applies the rules to the observed boats of one game; moves nothing.

    The rules are those of `BatchedMctf.follow`. The game begins once every boat was seen. From then on a boat not seen
    for ``lost_after_s`` counts as out of bounds until it is seen again.

    Attributes:
        names: of the boats, in the order of their agents.
        began: whether the game has begun.
        events: what happened at the last call of `watch`, a line each.

    Raises:
        GameError: the number of names differs from that of boats.
    """

    def __init__(self, config: GameConfig, names: Sequence[str], lost_after_s: float = 5.0) -> None:
        if len(names) != config.n_boats:
            raise GameError(f"{len(names)} names for {config.n_boats} boats; name each boat of the game")
        core = BatchedMctf(config)  # compiles the rules, so that the game's first seconds are not spent on it
        seen = core.state[..., : L.SPEED + 1].copy()
        core.start_seen(seen)
        core.follow(seen, config.dt_s)
        core.commands(np.zeros((1, config.n_boats, 2)))
        self.core = BatchedMctf(config)
        self.names = tuple(names)
        self.lost_after_s = lost_after_s
        self.began = False
        self.events: tuple[str, ...] = ()
        self._at_s = -math.inf

    @property
    def over(self) -> bool:
        """Whether the game has ended."""
        return bool(self.core.terminated[0] or self.core.truncated[0])

    def watch(self, contacts: Sequence[Contact], now_s: float) -> GameState:
        """Apply the rules to the latest contact of each boat and return the state of the game.

        After the end the state no longer changes. ``now_s`` is on the contacts' clock; other boats are ignored.
        """
        known = {contact.boat: contact for contact in contacts}
        seen = np.array([self._seen(known.get(name), now_s) for name in self.names])
        lost = [name for name, row in zip(self.names, seen, strict=True) if np.isnan(row[0])]
        self.events, note = (), ""
        if not self.began:
            if lost:
                waiting = [name for name in self.names if name not in known]
                return self.state(f"waiting for {', '.join(waiting) or 'boats that are lost'}")
            self.core.start_seen(seen[np.newaxis])
            self.began, self.events = True, ("the game begins",)
        elif not self.over:
            before = self.core.view()
            self.core.follow(seen[np.newaxis], max(0.0, now_s - self._at_s))
            self.events = tuple(self._events_since(before))
            note = f"lost, so out of bounds: {', '.join(lost)}" if lost else ""
        self._at_s = now_s
        return self.state(note)

    def _seen(self, contact: Contact | None, now_s: float) -> tuple[float, float, float, float]:
        """Return a boat's extrapolated x m, y m, heading deg and speed m/s; NaN if it is lost."""
        if contact is None or now_s - contact.fixed_s > self.lost_after_s:
            return (math.nan,) * 4
        (x_m, y_m), heading_rad = contact.position_m, contact.heading_rad
        ahead_m = contact.speed_mps * min(max(0.0, now_s - contact.fixed_s), CARRY_S)
        place = x_m + ahead_m * math.sin(heading_rad), y_m + ahead_m * math.cos(heading_rad)
        return *place, math.degrees(heading_rad), contact.speed_mps

    def state(self, note: str = "") -> GameState:
        """Return the state of the game as of the last call of `watch`."""
        if self.began:
            self.core.commands(np.zeros((1, len(self.names), 2)))  # updates which boats are game-controlled
        return state_of(self.core, self.names, note)

    def _events_since(self, before: Any) -> list[str]:
        core, events = self.core, []
        for i, name in enumerate(self.names):
            if core.made_tag[0, i] >= 0:
                events.append(f"{name} tags {self.names[core.made_tag[0, i]]}")
            if core.has_flag[0, i] and not before.has_flag[i]:
                events.append(f"{name} grabs the flag")
            if core.oob[0, i] and not before.oob[i]:
                events.append(f"{name} is out of bounds")
            if before.is_tagged[i] and not core.is_tagged[0, i]:
                events.append(f"{name} is free again")
        for team, side in enumerate(SIDES):
            if core.events[0, team, CAPTURE]:
                events.append(f"{side} captures the flag: {core.captures[0, 0]} : {core.captures[0, 1]}")
        return [*events, "the game is over"] if self.over else events


def state_of(core: BatchedMctf, names: Sequence[str], note: str = "") -> GameState:
    """Return the state of a running game (number 0 of ``core``) under the boats' names."""
    arrays = (core.is_tagged, core.has_flag, core.oob, core.on_side, core.tagging_cooldown_s, core.driven)
    rows = zip(*(array[0].tolist() for array in arrays), strict=True)
    keys = ("tagged", "has_flag", "oob", "on_side", "cooldown_s", "driven")
    boats = {name: BoatStatus(**dict(zip(keys, row, strict=True))) for name, row in zip(names, rows, strict=True)}
    places = zip(core.flag_position[0].tolist(), core.flag_taken[0].tolist(), strict=True)
    flags = [FlagStatus(x_m, y_m, bool(taken)) for (x_m, y_m), taken in places]
    counts = {name: tuple(getattr(core, name)[0].tolist()) for name in ("captures", "grabs", "tags")}
    over = bool(core.terminated[0] or core.truncated[0])
    return GameState(float(core.time_s[0]), boats, (flags[0], flags[1]), **counts, over=over, note=note)


RATE_HZ = 10.0
LINGER_S = 3.0  # how long the end of a game is published, s
OnState = Callable[[GameState, Sequence[str]], None]
"""Called each time with the state of the game and what happened, a line each."""


class Referee(Closing):
    """Receives positions, applies the rules, and publishes the state of the game. A context manager.

    Of several senders for one boat, the one heard first counts while it still sends.

    Args:
        fleet: the file.
        clock: of all times.
        listen: HOST:PORT to receive the feed at; None: the file's feed.referee.
        publish: HOST:PORT of further listeners, besides the file's runners.

    Raises:
        FleetFileError: the file has no game, or lacks an address to receive positions at or to publish to.
        BridgeError: an address cannot be listened at.
        ConfigError: an address is malformed, or the signing key cannot be read or other users can read it.
    """

    def __init__(self, fleet: FleetFile, clock: Clock, listen: str | None = None, publish: Sequence[str] = ()) -> None:
        self.umpire = Umpire(game_config(fleet), player_names(fleet), fleet.limits.contact.lost_after_s)
        to = tuple(dict.fromkeys((*fleet.feed_listeners(), *publish)))
        if not to:
            raise FleetFileError('nobody is told how the game stands; add feed.listen: "HOST:PORT", or give --publish')
        address = listen or (None if fleet.feed is None else fleet.feed.referee)
        if address is None:
            raise FleetFileError('nobody says where boats are; add feed.referee: "HOST:PORT", or give --listen')
        allow = ("127.0.0.1",) if fleet.feed is None else fleet.feed.allow
        self.clock, self._max_age_s = clock, fleet.limits.contact.max_age_s
        with contextlib.ExitStack() as stack:
            feed = FeedReceiver(address, fleet.frame, clock, allow, fleet.names, key_of(fleet))
            self.feed = stack.enter_context(feed)
            self._sender = stack.enter_context(FeedSender("referee", to, key_of(fleet)))
            self._open = stack.pop_all()

    def contacts(self) -> Sequence[Contact]:
        """Return the latest contact of each boat."""
        oldest_s = self.clock.now_s() - self._max_age_s
        found: dict[str, Contact] = {}
        for contact in self.feed.read():
            known = found.get(contact.boat)
            if known is None or known.fixed_s < min(oldest_s, contact.fixed_s):
                found[contact.boat] = contact
        return tuple(found.values())

    def turn(self) -> GameState:
        """Apply the rules once and publish the state."""
        state = self.umpire.watch(self.contacts(), self.clock.now_s())
        self._sender.send_game(state)
        return state

    def run(
        self, on_state: OnState, stopped: Callable[[], bool], rate_hz: float = RATE_HZ, limit_s: float | None = None
    ) -> str:
        """Run until the game is over, ``stopped()`` is true (checked before each turn), or ``limit_s`` has passed.

        Returns:
            Why it ended: "over", "stopped" or "time".
        """
        begun_s = due_s = self.clock.now_s()
        over_s: float | None = None
        while not stopped():
            state = self.turn()
            on_state(state, self.umpire.events)
            now_s = self.clock.now_s()
            if state.over:
                over_s = now_s if over_s is None else over_s
                if now_s - over_s >= LINGER_S:
                    return "over"
            elif limit_s is not None and now_s - begun_s >= limit_s:
                return "time"
            due_s = max(due_s + 1.0 / rate_hz, now_s)  # missed turns are skipped
            self.clock.sleep_until(due_s)
        return "stopped"

    def close(self) -> None:
        """Close the sockets; may be called again."""
        self._open.close()
