"""`Referee`: hears where boats are, keeps the game by the env's rules, and tells everybody how it stands."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender, GameState
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Contact
from steerclear.shield.bridge.session import key_of
from steerclear.shield.compat import Self
from steerclear.shield.exceptions import FleetFileError

from .rules import Umpire, game_config, player_names

RATE_HZ = 10.0
LINGER_S = 3.0
"""How long the end of a game is told, s."""
Told = Callable[[GameState, Sequence[str]], None]
"""Called each time with the state of the game and what happened, a line each."""


class Referee:
    """Hears positions, applies the rules, publishes the state of the game. A context manager.

    Of each boat the contact counts of who was heard first and still speaks.

    Args:
        fleet: the file.
        clock: of all times.
        listen: HOST:PORT to hear the feed at; None: the file's feed.referee.
        publish: HOST:PORT of further listeners, besides the file's runners.

    Raises:
        FleetFileError: the file has no game, or does not say where to hear positions or whom to tell.
        BridgeError: an address cannot be heard at.
        ConfigError: an address is none, or the signing key cannot be read or others can read it.
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
        """The latest contact of each boat heard of."""
        oldest_s = self.clock.now_s() - self._max_age_s
        found: dict[str, Contact] = {}
        for contact in self.feed.read():
            known = found.get(contact.boat)
            if known is None or known.fixed_s < min(oldest_s, contact.fixed_s):
                found[contact.boat] = contact
        return tuple(found.values())

    def turn(self) -> GameState:
        """Look once and tell everybody."""
        state = self.umpire.watch(self.contacts(), self.clock.now_s())
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
