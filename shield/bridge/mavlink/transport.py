"""Bytes in and out: UDP, TCP and serial wires behind one small interface, by the ``address`` of FLEET.yaml.

Nothing here waits but `Wire.open`.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from dataclasses import dataclass
from typing import Any

from ...exceptions import LinkError

KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial")
DEFAULT_BAUD = 57_600

Peer = tuple[str, int]
"""Who sent: host and port; on wires with one end, always the same."""

_DATAGRAM, _CHUNK, _WAITING, _DIAL_S = 65_535, 8_192, 2_048, 5.0
_REMEDIES = {
    errno.EADDRINUSE: "another program uses that port: end it or give another port",
    errno.EADDRNOTAVAIL: "this machine has no such address: give one it has, such as 127.0.0.1",
    errno.ECONNREFUSED: "nothing listens there: start the boat or correct the port",
    errno.EACCES: "this user may not use it: choose a port above 1023, or be in the device's group",
    errno.ENOENT: "there is no such device: plug it in or correct its name",
}


@dataclass(frozen=True)
class Address:
    """Where a link is.

    Attributes:
        kind: "udpin" (we listen), "udpout" (we send first), "tcp" (we dial), "tcpin" (we are dialled) or "serial".
        host: name or number of the host, or the device.
        number: port, or baud rate.
    """

    kind: str
    host: str
    number: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.number}"

    def error(self, error: OSError) -> LinkError:
        """What went wrong when the wire was opened, and what to do."""
        remedy = _REMEDIES.get(error.errno or 0, "check the address and the network")
        return LinkError(f"cannot open link {self} ({error.strerror or error}); {remedy}")

    def resolve(self, kind: int) -> tuple[int, Peer]:
        """Address family, and host and port in numbers.

        Raises:
            LinkError: nobody knows the host.
        """
        try:
            family, _, _, _, place = socket.getaddrinfo(self.host, self.number, type=kind)[0]
        except OSError as error:
            raise LinkError(f"link {self}: there is no host {self.host!r} ({error.strerror}); correct it") from None
        return family, (str(place[0]), int(place[1]))


def parse_address(text: str) -> Address:
    """Read ``udpin:127.0.0.1:14550``, ``tcp:HOST:PORT``, ``serial:/dev/ttyUSB0:57600`` and the like.

    Raises:
        LinkError: it is none of them.
    """
    kind, _, rest = text.partition(":")
    if kind not in KINDS or not rest:
        raise LinkError(
            f"link address {text!r} is none; give udpin:, udpout:, tcp:, tcpin:HOST:PORT or serial:DEVICE:BAUD"
        )
    host, colon, number = rest.rpartition(":")
    is_number = bool(colon) and number.isascii() and number.isdigit()
    if kind == "serial":
        return Address(kind, host, int(number)) if is_number else Address(kind, rest, DEFAULT_BAUD)
    if not host or not is_number or int(number) > 65535:
        raise LinkError(
            f"link address {text!r} has no host and port; give {kind}:HOST:PORT, such as {kind}:127.0.0.1:14550"
        )
    return Address(kind, host.strip("[]"), int(number))


class Wire:
    """One wire; this class is a stream with one end that is never there.

    Args:
        address: where it is.

    Attributes:
        datagrams: whether bytes come in packets.
        many: whether several peers may send on it.
    """

    datagrams = False
    many = False

    def __init__(self, address: Address) -> None:
        self.address = address
        self._pending = b""

    @property
    def port(self) -> int:
        """Our own port; 0 while there is none."""
        return 0

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Open it, or open it again after it was lost.

        Raises:
            LinkError: it cannot be opened; what to do about it.
        """
        raise NotImplementedError

    def fileno(self) -> int:
        """What to wait on; -1 while it is not open."""
        raise NotImplementedError

    def close(self) -> None:
        """Give it back."""
        raise NotImplementedError

    def receive(self) -> tuple[bytes, Peer] | None:
        """What came in; None when there is nothing.

        Raises:
            OSError: the wire is lost; it is closed, `open` may bring it back.
        """
        try:
            data = self._read()
        except (BlockingIOError, InterruptedError):
            return None
        except OSError:
            self._drop()
            raise
        if data == b"":
            self._drop()
            raise ConnectionResetError("the other end closed the connection, or the device is gone")
        return None if data is None else (data, (self.address.host, self.address.number))

    def send(self, data: bytes, peer: Peer | None) -> bool:
        """Send a whole frame or none of it: what did not fit is finished first. False when it could not leave now."""
        self._pending = self._pending[self._write(self._pending) :] if self._pending else b""
        if self._pending:
            return False
        sent = self._write(data)
        self._pending = data[sent:] if sent > 0 else b""
        return sent > 0

    def _read(self) -> bytes | None:
        """Some bytes; none of them: the end is gone; None: it is not there."""
        raise NotImplementedError

    def _write(self, data: bytes) -> int:
        """How many bytes left; 0: the wire is full, or lost: then the reader finds out and opens it again."""
        raise NotImplementedError

    def _drop(self) -> None:
        """Give the connection back."""
        self.close()


class UdpWire(Wire):
    """UDP. ``udpin`` listens and answers each peer where it sent from; ``udpout`` has one peer.

    The port is bound exclusively: two programs on one port would each hear some of the packets.
    """

    datagrams = True

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        self._socket: socket.socket | None = None
        self.many = address.kind == "udpin"

    @property
    def port(self) -> int:
        """Our own port; 0 while closed."""
        return 0 if self._socket is None else int(self._socket.getsockname()[1])

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Bind, or choose a peer; see `Wire`."""
        self.close()
        family, place = self.address.resolve(socket.SOCK_DGRAM)
        made = socket.socket(family, socket.SOCK_DGRAM)
        try:
            made.setblocking(False)
            made.bind(place) if self.many else made.connect(place)
        except OSError as error:
            made.close()
            raise self.address.error(error) from None
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
            sent = self._socket.sendto(data, peer) if self.many and peer is not None else self._socket.send(data)
        except OSError:
            return False
        return sent == len(data)

    def close(self) -> None:
        """See `Wire`."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class TcpWire(Wire):
    """TCP. ``tcp`` dials, ``tcpin`` waits to be dialled, by one peer at a time."""

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        self._listener: socket.socket | None = None
        self._socket: socket.socket | None = None

    @property
    def port(self) -> int:
        """The port we listen at; 0 when we dial."""
        return 0 if self._listener is None else int(self._listener.getsockname()[1])

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Dial or listen; see `Wire`."""
        self._drop()
        if self._listener is not None:
            return
        family, place = self.address.resolve(socket.SOCK_STREAM)
        made = socket.socket(family, socket.SOCK_STREAM)
        try:
            if self.address.kind == "tcp":
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
            raise self.address.error(error) from None

    def _take(self, made: socket.socket) -> None:
        made.setblocking(False)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _WAITING)  # old commands must not queue up for seconds
        self._socket, self._pending = made, b""

    def fileno(self) -> int:
        """See `Wire`."""
        chosen = self._socket or self._listener
        return -1 if chosen is None else chosen.fileno()

    def _read(self) -> bytes | None:
        if self._socket is None and self._listener is not None:
            with contextlib.suppress(BlockingIOError, InterruptedError, ConnectionError):
                self._take(self._listener.accept()[0])
        return None if self._socket is None else self._socket.recv(_CHUNK)

    def _write(self, data: bytes) -> int:
        try:
            return 0 if self._socket is None else self._socket.send(data)
        except OSError:
            return 0

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


class SerialWire(Wire):
    """A serial port with one autopilot or radio at its end: 8 bits, no parity, no flow control."""

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        self._port: Any = None

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Open the device; see `Wire`."""
        try:
            import serial  # only whoever has a radio needs it
        except ImportError:
            raise LinkError(f"link {self.address}: pyserial is not installed; run: pip install pyserial") from None
        self.close()
        if self.address.number not in serial.Serial.BAUDRATES:
            known = [rate for rate in serial.Serial.BAUDRATES if rate >= 9600]
            raise LinkError(f"link {self.address}: no baud rate {self.address.number}; give one of {known}")
        try:
            self._port = serial.Serial(self.address.host, self.address.number, timeout=0, write_timeout=0)
        except OSError as error:  # SerialException is one; its text holds the system's
            if error.errno in _REMEDIES:
                raise self.address.error(OSError(error.errno, os.strerror(error.errno or 0))) from None
            raise LinkError(f"link {self.address}: that is no serial port ({error}); name one") from None
        self._pending = b""

    def fileno(self) -> int:
        """See `Wire`."""
        return -1 if self._port is None else int(self._port.fileno())

    def _read(self) -> bytes | None:
        return None if self._port is None else self._port.read(_CHUNK) or None  # one that is gone raises

    def _write(self, data: bytes) -> int:
        try:
            return 0 if self._port is None else int(self._port.write(data) or 0)
        except OSError:
            return 0

    def close(self) -> None:
        """See `Wire`."""
        if self._port is not None:
            with contextlib.suppress(OSError):
                self._port.close()
            self._port = None
        self._pending = b""


def make_wire(address: Address) -> Wire:
    """The wire of an address, not yet open."""
    if address.kind == "serial":
        return SerialWire(address)
    return UdpWire(address) if address.kind.startswith("udp") else TcpWire(address)
