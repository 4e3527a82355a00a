"""The wires: non-blocking UDP and TCP sockets behind one small interface; serial ports are in `serial_port`."""

from __future__ import annotations

import contextlib
import errno
import socket
from typing import Protocol

from ...exceptions import LinkError
from .addresses import Address

Peer = tuple[str, int]
"""Who sent: host and port; on wires with one end, always the same."""

_DATAGRAM = 65_535
_CHUNK = 8_192
_WAITING = 2_048
_DIAL_S = 5.0


class Wire(Protocol):
    """Bytes in and out; nothing here waits but `open`.

    Attributes:
        datagrams: whether bytes come in packets.
        many: whether several peers may send on it.
    """

    datagrams: bool
    many: bool

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Open it, or open it again after it was lost.

        Raises:
            LinkError: it cannot be opened; what to do about it.
        """

    def fileno(self) -> int:
        """What to wait on; -1 while it is not open."""

    def receive(self) -> tuple[bytes, Peer] | None:
        """What came in; None when there is nothing.

        Raises:
            OSError: the wire is lost; it is closed, `open` may bring it back.
        """

    def send(self, data: bytes, peer: Peer | None) -> bool:
        """Send all or nothing; False when it could not leave now."""

    def close(self) -> None:
        """Give it back."""


_REMEDIES = {
    errno.EADDRINUSE: "another program uses that port: end it or give another port",
    errno.EADDRNOTAVAIL: "this machine has no such address: give one it has, such as 127.0.0.1",
    errno.ECONNREFUSED: "nothing listens there: start the boat or correct the port",
    errno.EACCES: "this user may not use it: choose a port above 1023, or be in the device's group",
    errno.ENOENT: "there is no such device: plug it in or correct its name",
}


def explain(address: Address, error: OSError) -> LinkError:
    """What went wrong when a wire was opened, and what to do."""
    remedy = _REMEDIES.get(error.errno or 0, "check the address and the network")
    return LinkError(f"cannot open link {address} ({error.strerror or error}); {remedy}")


def _resolve(address: Address, kind: int) -> tuple[int, Peer]:
    try:
        family, _, _, _, place = socket.getaddrinfo(address.host, address.number, type=kind)[0]
    except OSError as error:
        raise LinkError(f"link {address}: there is no host {address.host!r} ({error.strerror}); correct it") from None
    return family, (str(place[0]), int(place[1]))


class UdpWire:
    """UDP. ``udpin`` listens and answers each peer where it sent from; ``udpout`` has one peer.

    The port is bound exclusively: two programs on one port would each hear some of the packets.
    """

    datagrams = True

    def __init__(self, address: Address) -> None:
        self._address = address
        self._socket: socket.socket | None = None
        self.many = address.kind == "udpin"

    @property
    def port(self) -> int:
        """Our own port; 0 while closed."""
        return 0 if self._socket is None else int(self._socket.getsockname()[1])

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Bind, or choose a peer; see `Wire`."""
        self.close()
        family, place = _resolve(self._address, socket.SOCK_DGRAM)
        made = socket.socket(family, socket.SOCK_DGRAM)
        try:
            made.setblocking(False)
            if self.many:
                made.bind(place)
            else:
                made.connect(place)
        except OSError as error:
            made.close()
            raise explain(self._address, error) from None
        self._socket = made

    def fileno(self) -> int:
        """See `Wire`."""
        return -1 if self._socket is None else self._socket.fileno()

    def receive(self) -> tuple[bytes, Peer] | None:
        """One datagram; see `Wire`."""
        if self._socket is None:
            return None
        try:
            data, peer = self._socket.recvfrom(_DATAGRAM)
        except (BlockingIOError, InterruptedError, ConnectionError):
            return None  # ConnectionError: the peer's machine says nobody listens there; it may yet
        return data, (str(peer[0]), int(peer[1]))

    def send(self, data: bytes, peer: Peer | None) -> bool:
        """One datagram; see `Wire`."""
        if self._socket is None or (self.many and peer is None):
            return False
        try:
            if self.many and peer is not None:
                return self._socket.sendto(data, peer) == len(data)
            return self._socket.send(data) == len(data)
        except OSError:
            return False

    def close(self) -> None:
        """See `Wire`."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class TcpWire:
    """TCP. ``tcp`` dials, ``tcpin`` waits to be dialled, by one peer at a time."""

    datagrams = False
    many = False

    def __init__(self, address: Address) -> None:
        self._address = address
        self._listener: socket.socket | None = None
        self._socket: socket.socket | None = None
        self._pending = b""
        self._peer: Peer = (address.host, address.number)

    @property
    def port(self) -> int:
        """The port we listen at; 0 when we dial."""
        return 0 if self._listener is None else int(self._listener.getsockname()[1])

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Dial or listen; see `Wire`."""
        self._drop()
        if self._listener is not None:
            return
        family, place = _resolve(self._address, socket.SOCK_STREAM)
        made = socket.socket(family, socket.SOCK_STREAM)
        try:
            if self._address.kind == "tcp":
                made.settimeout(timeout_s)
                made.connect(place)
                self._take(made)
            else:
                made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                made.bind(place)
                made.listen(1)
                made.setblocking(False)
                self._listener = made
        except OSError as error:
            made.close()
            raise explain(self._address, error) from None

    def _take(self, made: socket.socket) -> None:
        made.setblocking(False)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _WAITING)  # old commands must not queue up for seconds
        self._socket, self._pending = made, b""

    def fileno(self) -> int:
        """See `Wire`."""
        chosen = self._socket or self._listener
        return -1 if chosen is None else chosen.fileno()

    def receive(self) -> tuple[bytes, Peer] | None:
        """Some bytes; see `Wire`."""
        if self._socket is None:
            self._accept()
        if self._socket is None:
            return None
        try:
            data = self._socket.recv(_CHUNK)
        except (BlockingIOError, InterruptedError):
            return None
        except OSError:
            self._drop()
            raise
        if not data:
            self._drop()
            raise ConnectionResetError("the boat closed the connection")
        return data, self._peer

    def _accept(self) -> None:
        if self._listener is not None:
            with contextlib.suppress(BlockingIOError, InterruptedError, ConnectionError):
                made, _ = self._listener.accept()
                self._take(made)

    def send(self, data: bytes, peer: Peer | None) -> bool:
        """A whole frame or none of it: what did not fit is finished first; see `Wire`."""
        if self._pending:
            self._pending = self._pending[self._write(self._pending) :]
        if self._pending:
            return False
        sent = self._write(data)
        self._pending = data[sent:] if sent > 0 else b""
        return sent > 0

    def _write(self, data: bytes) -> int:
        made = self._socket
        try:
            return 0 if made is None else made.send(data)
        except OSError:
            return 0  # full, or lost: then the reader finds out and opens it again

    def _drop(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._pending = b""

    def close(self) -> None:
        """See `Wire`."""
        self._drop()
        if self._listener is not None:
            self._listener.close()
            self._listener = None
