"""`FeedSender`: positions and the state of the game out over UDP."""

from __future__ import annotations

import logging
import random
from collections.abc import Iterable, Sequence
from types import TracebackType

from ..compat import Self
from .feed_packets import Fix, GameState, Packet
from .feed_seal import Seal
from .feed_sockets import ip_version, numeric_host, sending_socket, socket_address
from .mavlink.signing import SigningClock

logger = logging.getLogger(__name__)


class FeedSender:
    """Sends packets of the feed under one name; never waits. A context manager.

    Args:
        sender: its name.
        to: HOST:PORT of each listener.
        key: the 32-byte signing key, so that packets are sealed; None: they are not.

    Raises:
        ConfigError: an address is not of that form, or its host unknown, or the key has another length.
    """

    def __init__(self, sender: str, to: Iterable[str], key: bytes | None = None) -> None:
        self.sender = sender
        self._seal = None if key is None else Seal(key)
        self._clock = SigningClock()
        self.run = random.SystemRandom().randrange(1, 2**31)
        addresses = [socket_address(address) for address in to]
        self._to = tuple((numeric_host(host), port) for host, port in addresses)
        self._seq = 0
        self._sockets = {version: sending_socket(version) for version in {ip_version(host) for host, _ in self._to}}

    def send_positions(self, fixes: Sequence[Fix]) -> None:
        """Send where boats are.

        Raises:
            FeedError: a value is not finite, or there are too many boats for one packet.
        """
        self._send(Packet(self.sender, self.run, self._seq, fixes=tuple(fixes), stamp=self._stamp()))

    def send_game(self, game: GameState) -> None:
        """Send how the game stands.

        Raises:
            FeedError: a value is not finite, or the packet is too long.
        """
        self._send(Packet(self.sender, self.run, self._seq, game=game, stamp=self._stamp()))

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

    def _stamp(self) -> int | None:
        return None if self._seal is None else self._clock.take()

    def _send(self, packet: Packet) -> None:
        data = packet.encode()
        if self._seal is not None:
            data = self._seal.close(data)
        self._seq += 1
        for host, port in self._to:
            try:
                self._sockets[ip_version(host)].sendto(data, (host, port))
            except OSError as error:  # nobody listens there now, or the network is away: the next packet tries again
                logger.debug("feed to %s:%d: %s", host, port, error)
