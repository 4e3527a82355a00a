"""`FeedSender`: positions and the state of the game out over UDP."""

from __future__ import annotations

import logging
import random
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Self

from .feed_packets import Fix, GameState, Packet
from .feed_sockets import ip_version, numeric_host, sending_socket, socket_address

logger = logging.getLogger(__name__)


class FeedSender:
    """Sends packets of the feed under one name; never waits. A context manager.

    Args:
        sender: its name.
        to: HOST:PORT of each listener.

    Raises:
        ConfigError: an address is not of that form, or its host unknown.
    """

    def __init__(self, sender: str, to: Iterable[str]) -> None:
        self.sender = sender
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
        self._send(Packet(self.sender, self.run, self._seq, fixes=tuple(fixes)).encode())

    def send_game(self, game: GameState) -> None:
        """Send how the game stands.

        Raises:
            FeedError: a value is not finite, or the packet is too long.
        """
        self._send(Packet(self.sender, self.run, self._seq, game=game).encode())

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

    def _send(self, data: bytes) -> None:
        self._seq += 1
        for host, port in self._to:
            try:
                self._sockets[ip_version(host)].sendto(data, (host, port))
            except OSError as error:  # nobody listens there now, or the network is away: the next packet tries again
                logger.debug("feed to %s:%d: %s", host, port, error)
