"""UDP ends of simulated boats, never blocking."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator

from .frames import FrameCutter

_DATAGRAM = 65536
_MOST_PEERS = 8


def _socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    return made


class UdpListener:
    """Listens; answers everybody heard lately, at most the latest eight."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = _socket()
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self.address = f"udpout:{host}:{self._socket.getsockname()[1]}"
        self._cutters: dict[tuple[str, int], FrameCutter] = {}

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on."""
        return [self._socket]

    def read(self) -> Iterator[bytes]:
        """Whole packets that have come in."""
        while True:
            try:
                data, peer = self._socket.recvfrom(_DATAGRAM)
            except BlockingIOError:
                return
            except ConnectionError:  # an earlier answer found nobody listening
                continue
            cutter = self._cutters.pop(peer, None) or FrameCutter()
            self._cutters[peer] = cutter  # the latest heard comes last
            while len(self._cutters) > _MOST_PEERS:
                del self._cutters[next(iter(self._cutters))]
            yield from cutter.cut(data)

    def write(self, packet: bytes) -> None:
        """Send to whoever is there; what cannot be sent is lost."""
        for peer in list(self._cutters):
            with contextlib.suppress(OSError):
                self._socket.sendto(packet, peer)

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()


class UdpCaller:
    """Sends to a fixed place from a port of its own and hears what comes back."""

    def __init__(self, host: str, port: int) -> None:
        self.address = f"udpin:{host}:{port}"
        self._peer = (host, port)
        self._socket = _socket()
        self._cutter = FrameCutter()

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on."""
        return [self._socket]

    def read(self) -> Iterator[bytes]:
        """Whole packets that have come in."""
        while True:
            try:
                data, _ = self._socket.recvfrom(_DATAGRAM)
            except BlockingIOError:
                return
            except ConnectionError:  # nobody listens there yet
                continue
            yield from self._cutter.cut(data)

    def write(self, packet: bytes) -> None:
        """Send; what cannot be sent is lost."""
        with contextlib.suppress(OSError):
            self._socket.sendto(packet, self._peer)

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()
