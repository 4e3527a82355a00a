"""`Referee`: hears where boats are, keeps the game by the env's rules, and tells everybody how it stands."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender, GameState
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Contact, Link, LinkMaker, contact_of
from steerclear.shield.bridge.session import LINK_MAKERS, key_of
from steerclear.shield.compat import Self
from steerclear.shield.exceptions import FleetFileError

from .rules import Umpire, game_config, player_names

CONNECT_S = 15.0
RATE_HZ = 10.0
LINGER_S = 3.0
"""How long the end of a game is told, s."""
Told = Callable[[GameState, Sequence[str]], None]
"""Called each time with the state of the game and what happened, a line each."""


class Hearing:
    """Hears boats; commands none. A context manager.

    Args:
        fleet: the file.
        clock: of all times.
        listen: HOST:PORT to hear the feed at; None: the file's feed.referee.
        links: whether boats that have a link are heard there too.

    Raises:
        FleetFileError: neither the file nor ``listen`` says where to hear positions.
        BridgeError: an address cannot be heard at, or a boat does not answer.
        ConfigError: the signing key cannot be read, or others can read it.
    """

    def __init__(self, fleet: FleetFile, clock: Clock, listen: str | None = None, links: bool = False) -> None:
        address = listen or (None if fleet.feed is None else fleet.feed.referee)
        if address is None and not links:
            raise FleetFileError(
                'nobody says where boats are; add feed.referee: "HOST:PORT", or give --listen or --links'
            )
        self.feed: FeedReceiver | None = None
        self._error_m = fleet.shield_config.position_error_m
        self._clock, self._max_age_s = clock, fleet.limits.contact.max_age_s
        self._links: list[Link] = []
        with contextlib.ExitStack() as stack:
            if address is not None:
                allow = ("127.0.0.1",) if fleet.feed is None else fleet.feed.allow
                feed = FeedReceiver(address, fleet.frame, clock, allow, fleet.names, key_of(fleet))
                self.feed = stack.enter_context(feed)
            if links:
                self._connect(fleet, clock, stack)
            self._open = stack.pop_all()

    def contacts(self) -> Sequence[Contact]:
        """The latest contact of each boat heard of: of its own link, else of who was heard first and still speaks."""
        told = [contact_of(link.read(), self._error_m) for link in self._links]
        heard = () if self.feed is None else self.feed.read()
        oldest_s = self._clock.now_s() - self._max_age_s
        found: dict[str, Contact] = {}
        for contact in (*(entry for entry in told if entry is not None), *heard):
            known = found.get(contact.boat)
            if known is None or known.fixed_s < min(oldest_s, contact.fixed_s):
                found[contact.boat] = contact
        return tuple(found.values())

    def close(self) -> None:
        """Give everything back, telling no boat anything; may be called again."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _connect(self, fleet: FleetFile, clock: Clock, stack: contextlib.ExitStack) -> None:
        makers: dict[str, LinkMaker] = {}
        for boat in fleet.boats:
            if boat.link is not None:
                if boat.link.kind not in makers:
                    makers[boat.link.kind] = LINK_MAKERS[boat.link.kind](fleet, clock, None)
                    stack.callback(makers[boat.link.kind].close)
                self._links.append(makers[boat.link.kind].link(boat))
        for link in self._links:
            stack.callback(link.release)
        for maker in makers.values():
            maker.open()
        for link in self._links:
            link.connect(CONNECT_S)


class Referee:
    """Hears positions, applies the rules, publishes the state of the game. A context manager.

    As `Hearing`; ``publish`` are HOST:PORT of further listeners, besides the file's runners.

    Raises:
        FleetFileError: the file has no game, or does not say where to hear positions or whom to tell.
        BridgeError: an address cannot be heard at, or a boat does not answer.
        ConfigError: an address is none, or the signing key cannot be read or others can read it.
    """

    def __init__(
        self,
        fleet: FleetFile,
        clock: Clock,
        listen: str | None = None,
        publish: Sequence[str] = (),
        links: bool = False,
    ) -> None:
        self.umpire = Umpire(game_config(fleet), player_names(fleet), fleet.limits.contact.lost_after_s)
        to = tuple(dict.fromkeys((*fleet.feed_listeners(), *publish)))
        if not to:
            raise FleetFileError('nobody is told how the game stands; add feed.listen: "HOST:PORT", or give --publish')
        self.clock = clock
        with contextlib.ExitStack() as stack:
            self.hearing = stack.enter_context(Hearing(fleet, clock, listen, links))
            self._sender = FeedSender("referee", to, key_of(fleet))
            stack.callback(self._sender.close)
            self._open = stack.pop_all()

    def turn(self) -> GameState:
        """Look once and tell everybody."""
        state = self.umpire.watch(self.hearing.contacts(), self.clock.now_s())
        self._sender.send_game(state)
        return state

    def run(
        self, told: Told, stopped: Callable[[], bool], rate_hz: float = RATE_HZ, limit_s: float | None = None
    ) -> str:
        """Keep the game until it is over, stopped (asked before each look), or the time from now is up.

        Returns:
            Why it ended: "over", "stopped" or "time".
        """
        begun_s = due_s = self.clock.now_s()
        over_s: float | None = None
        while not stopped():
            state = self.turn()
            told(state, self.umpire.events)
            now_s = self.clock.now_s()
            if state.over:
                over_s = now_s if over_s is None else over_s
                if now_s - over_s >= LINGER_S:
                    return "over"
            elif limit_s is not None and now_s - begun_s >= limit_s:
                return "time"
            due_s = max(due_s + 1.0 / rate_hz, now_s)  # what was missed is not made up for
            self.clock.sleep_until(due_s)
        return "stopped"

    def close(self) -> None:
        """Give the sockets back; may be called again."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
