"""`FeedSender`: positions and the state of the game out over UDP; `PositionPublisher` sends those of our boats."""

from __future__ import annotations

import logging
import math
import random
import socket
from collections.abc import Iterable, Sequence
from types import TracebackType

from ..compat import Self
from ..exceptions import ConfigError, FeedError
from .feed_packets import Fix, Packet, Seal
from .frame import FieldFrame
from .game_state import GameState
from .mavlink.signing import SigningClock
from .messages import Tick

LOG = logging.getLogger(__name__)

PUBLISH_EVERY = 2
"""Every second tick's positions are published."""


def socket_address(text: str) -> tuple[str, int]:
    """Host and port of HOST:PORT; an IPv6 host may stand in brackets.

    Raises:
        ConfigError: it is not of that form.
    """
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isdecimal() or int(port) > 65535:
        raise ConfigError(f'{text!r} is no address; give "HOST:PORT", such as "127.0.0.1:14700"')
    return host, int(port)


def family_of(host: str) -> socket.AddressFamily:
    """IPv6 or IPv4; names, such as localhost, count as IPv4."""
    return socket.AF_INET6 if ":" in host else socket.AF_INET


class FeedSender:
    """Sends packets of the feed under one name; never waits. A context manager.

    Args:
        sender: its name.
        to: HOST:PORT of each listener; looked up once, since a name server could be waited for.
        key: the 32-byte signing key, so that packets are sealed; None: they are not.

    Raises:
        ConfigError: an address is not of that form, or its host unknown, or the key has another length.
    """

    def __init__(self, sender: str, to: Iterable[str], key: bytes | None = None) -> None:
        self.sender = sender
        self.run = random.SystemRandom().randrange(1, 2**31)
        self._seal, self._clock, self._seq = None if key is None else Seal(key), SigningClock(), 0
        self._to: list[tuple[str, int]] = []
        for host, port in map(socket_address, to):
            try:
                found = socket.getaddrinfo(host, None, family_of(host), socket.SOCK_DGRAM)
            except OSError as error:
                raise ConfigError(f"nobody knows the host {host!r} ({error.strerror}); give its address") from None
            self._to.append((str(found[0][4][0]), port))
        families = {family_of(host) for host, _ in self._to}
        self._sockets = {family: socket.socket(family, socket.SOCK_DGRAM) for family in families}
        for opened in self._sockets.values():
            opened.setblocking(False)

    def send_positions(self, fixes: Sequence[Fix]) -> None:
        """Send where boats are.

        Raises:
            FeedError: a value is not finite, or there are too many boats for one packet.
        """
        self._send(fixes=tuple(fixes))

    def send_game(self, game: GameState) -> None:
        """Send how the game stands.

        Raises:
            FeedError: a value is not finite, or the packet is too long.
        """
        self._send(game=game)

    def close(self) -> None:
        """Give the sockets back; may be called again."""
        for entry in self._sockets.values():
            entry.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _send(self, fixes: tuple[Fix, ...] = (), game: GameState | None = None) -> None:
        stamp = None if self._seal is None else self._clock.take()
        data = Packet(self.sender, self.run, self._seq, fixes, game, stamp=stamp).encode()
        data = data if self._seal is None else self._seal.close(data)
        self._seq += 1
        for host, port in self._to:
            try:
                self._sockets[family_of(host)].sendto(data, (host, port))
            except OSError as error:  # nobody listens there now, or the network is away: the next packet tries again
                LOG.debug("feed to %s:%d: %s", host, port, error)


class PositionPublisher:
    """A sink that tells others where our boats are: teammates' runners, the other team's, the referee.

    Args:
        sender: sends them.
        frame: the field's.
        error_m: bound of their position errors, m.
    """

    def __init__(self, sender: FeedSender, frame: FieldFrame, error_m: float) -> None:
        self._sender, self._frame, self._error_m = sender, frame, error_m
        self._told = False

    def take(self, tick: Tick) -> None:
        """Send the fixes of a tick."""
        fixes = []
        for reading in tick.readings.values():
            if math.isfinite(reading.age_s):
                place = self._frame.to_geodetic_deg(*reading.position_m)
                heading_deg = math.degrees(self._frame.heading_to_true_rad(reading.heading_rad))
                fixes.append(Fix(reading.boat, *place, heading_deg, reading.speed_mps, reading.age_s, self._error_m))
        if not fixes or tick.number % PUBLISH_EVERY:
            return
        try:
            self._sender.send_positions(fixes)
        except FeedError as error:  # an impossible reading must not stop the others for good
            if not self._told:
                LOG.warning("positions not published: %s", error)
            self._told = True

    def close(self) -> None:
        """Give the socket back."""
        self._sender.close()
