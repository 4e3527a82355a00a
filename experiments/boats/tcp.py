"""TCP ends of simulated boats, never blocking."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator

from .frames import FrameCutter

_CHUNK = 65536
_MOST_UNSENT = 1 << 18
"""Bytes a peer may be behind before it is dropped."""
_REDIAL_S = 0.5


class TcpPeer:
    """One connection."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.is_open = True
        self._cutter = FrameCutter()
        self._unsent = bytearray()
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self) -> Iterator[bytes]:
        """Whole packets that have come in; the end of the connection closes it."""
        while self.is_open:
            try:
                data = self.socket.recv(_CHUNK)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self.close()
                return
            yield from self._cutter.cut(data)

    def write(self, packet: bytes) -> None:
        """Send in order; a peer that does not keep up is dropped."""
        self._unsent += packet
        try:
            del self._unsent[: self.socket.send(self._unsent)]
        except BlockingIOError:
            if len(self._unsent) > _MOST_UNSENT:
                self.close()
        except OSError:
            self.close()

    def close(self) -> None:
        """Give the socket back."""
        self.is_open = False
        self.socket.close()


class TcpListener:
    """Serves any number of connections."""

    def __init__(self, host: str, port: int) -> None:
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._server.bind((host, port))
            self._server.listen(4)
        except OSError:
            self._server.close()
            raise
        self._server.setblocking(False)
        self.address = f"tcp:{host}:{self._server.getsockname()[1]}"
        self._peers: list[TcpPeer] = []

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on."""
        return [self._server, *(peer.socket for peer in self._peers if peer.is_open)]

    def read(self) -> Iterator[bytes]:
        """Whole packets that have come in."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            self._peers.append(TcpPeer(self._server.accept()[0]))
        for peer in self._peers:
            yield from peer.read()
        self._tidy()

    def write(self, packet: bytes) -> None:
        """Send to every connection."""
        for peer in self._peers:
            peer.write(packet)
        self._tidy()

    def close(self) -> None:
        """Give the sockets back."""
        for peer in self._peers:
            peer.close()
        self._server.close()

    def _tidy(self) -> None:
        self._peers = [peer for peer in self._peers if peer.is_open]


class TcpCaller:
    """Dials a server, again and again until it answers."""

    def __init__(self, host: str, port: int) -> None:
        self.address = f"tcpin:{host}:{port}"
        self._place = (host, port)
        self._peer: TcpPeer | None = None
        self._dial_s = 0.0

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on."""
        return [self._peer.socket] if self._peer is not None and self._peer.is_open else []

    def read(self) -> Iterator[bytes]:
        """Whole packets that have come in."""
        self._dial()
        if self._peer is not None:
            yield from self._peer.read()

    def write(self, packet: bytes) -> None:
        """Send; without a connection it is lost."""
        self._dial()
        if self._peer is not None:
            self._peer.write(packet)

    def close(self) -> None:
        """Give the socket back."""
        if self._peer is not None:
            self._peer.close()
        self._dial_s = float("inf")

    def _dial(self) -> None:
        if self._peer is not None and self._peer.is_open:
            return
        self._peer = None
        if time.monotonic() < self._dial_s:
            return
        self._dial_s = time.monotonic() + _REDIAL_S
        with contextlib.suppress(OSError):
            self._peer = TcpPeer(socket.create_connection(self._place, timeout=0.2))
