"""Bytes in and out: UDP, TCP and serial wires behind one small interface, by the ``address`` of FLEET.yaml.

Nothing here waits but `Wire.open`.
"""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import os
import re
import socket
from dataclasses import dataclass
from typing import Any

from ...exceptions import LinkError

KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial")
DEFAULT_BAUD = 57_600
_HOST = r"[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63}){0,15}\.?|\[[0-9A-Fa-f:.]{2,45}(%[A-Za-z0-9]{1,16})?\]"
_PLACE = re.compile(rf"(?P<host>{_HOST}):(?P<port>[0-9]{{1,5}})")
_NUMERIC = re.compile(r"(^|\.)(0[xX][0-9A-Fa-f]*|[0-9]+)\.?$|[\[\]]")
_DEVICE = re.compile(r"(?P<name>[^:]+|/dev/serial/by-.+?)(:(?P<baud>[0-9]{1,7}))?")  # names by path hold colons

Peer = tuple[Any, ...]
"""Who sent: host and port, of IPv6 also flow and scope, as sockets take it; on wires with one end, always the same."""

_DATAGRAM, _CHUNK, _WAITING, _DIAL_S = 65_535, 8_192, 2_048, 5.0
_REMEDIES = {
    errno.EADDRINUSE: "another program (another runner?) uses that port: end it or give another port",
    errno.EADDRNOTAVAIL: "this machine has no such address: give one it has, such as 127.0.0.1",
    errno.ECONNREFUSED: "nothing listens there: start the boat or correct the port",
    errno.EACCES: "this user may not use it: choose a port above 1023, or be in the device's group",
    errno.ENOENT: "there is no such device: plug it in or correct its name",
}


@dataclass(frozen=True)
class Address:
    """Where a link is."""

    kind: str  # "udpin" (we listen), "udpout" (we send first), "tcp" (we dial), "tcpin" (we are dialled) or "serial"
    host: str  # name or number of the host, or the device
    number: int  # port, or baud rate

    def __str__(self) -> str:
        place = f"{self.host}:{self.number}" if self.kind == "serial" else place_text(self.host, self.number)
        return f"{self.kind}:{place}"


def parse_address(text: str) -> Address:
    """Read ``udpin:127.0.0.1:14550``, ``tcp:HOST:PORT``, ``serial:/dev/ttyUSB0:57600`` and the like.

    Raises:
        LinkError: it is none of them.
    """
    kind, _, rest = text.partition(":")
    if kind not in KINDS:
        kinds = f"{', '.join(f'{kind}:...' for kind in KINDS)}, such as udpin:127.0.0.1:14550"
        raise LinkError(f"link address {text!r}; give one of {kinds}")
    device, place = _DEVICE.fullmatch(rest), host_and_port(rest)
    if kind == "serial" and device is not None:
        return Address(kind, device["name"], int(device["baud"] or DEFAULT_BAUD))
    if kind == "serial":
        raise LinkError(f"link address {text!r}; give serial:DEVICE:BAUD, such as serial:/dev/ttyUSB0:57600")
    if place is None:
        raise LinkError(f"link address {text!r}; give {kind}:HOST:PORT, such as {kind}:127.0.0.1:14550")
    return Address(kind, *place)


def host_and_port(text: str) -> tuple[str, int] | None:
    """Host and port of HOST:PORT; None: it is not of that form, or its host means more than one thing.

    An IPv6 host stands in brackets. What ends in a number is a plain address, not one in octal (010.0.0.1) or cut.
    """
    found = _PLACE.fullmatch(text)
    if found is None or int(found["port"]) > 65535:
        return None
    host = found["host"].strip("[]")
    if _NUMERIC.search(found["host"]):
        try:
            ipaddress.ip_address(host)
        except ValueError:
            return None
    return host, int(found["port"])


def place_text(host: str, number: int) -> str:
    """HOST:PORT as `host_and_port` reads it."""
    return f"[{host}]:{number}" if ":" in host else f"{host}:{number}"


class Wire:
    """One wire; the classes below say how bytes get on and off it.

    Args:
        address: where it is.

    Attributes:
        datagrams: whether bytes come in packets.
        many: whether several peers may send on it.
    """

    datagrams = False

    def __init__(self, address: Address) -> None:
        self.address, self.many = address, address.kind == "udpin"
        self._end: Any = None  # a socket, or a serial port
        self._listener: socket.socket | None = None
        self._pending = b""

    @property
    def port(self) -> int:
        """Our own port, where we listen or, over UDP, send from; else 0."""
        listens = self._end if self.datagrams else self._listener
        return 0 if listens is None else int(listens.getsockname()[1])

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Open it, or open it again after it was lost.

        Raises:
            LinkError: it cannot be opened; what to do about it.
        """
        raise NotImplementedError

    def fileno(self) -> int:
        """What to wait on; -1 while it is not open."""
        opened = self._listener if self._end is None else self._end
        return -1 if opened is None else int(opened.fileno())

    def close(self) -> None:
        """Give it back."""
        self._drop()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

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

    def _put(self, data: bytes) -> int | None:
        """Hand bytes over; how many were taken."""
        raise NotImplementedError

    def _write(self, data: bytes) -> int:
        """How many bytes left; 0: the wire is full, or lost: then the reader finds out and opens it again."""
        try:
            return 0 if self._end is None else int(self._put(data) or 0)
        except OSError:
            return 0

    def _drop(self) -> None:
        """Give the connection back."""
        if self._end is not None:
            with contextlib.suppress(OSError):
                self._end.close()
        self._end, self._pending = None, b""

    def _failed(self, error: OSError) -> LinkError:
        """What went wrong when the wire was opened, and what to do."""
        remedy = _REMEDIES.get(error.errno or 0, "check the address and the network")
        return LinkError(f"cannot open link {self.address} ({error.strerror or error}); {remedy}")

    def _socket(self, kind: int) -> tuple[socket.socket, Peer]:
        """A socket of the address's family, and its place in numbers."""
        try:
            family, _, _, _, place = socket.getaddrinfo(self.address.host, self.address.number, type=kind)[0]
        except OSError as error:
            host = self.address.host
            raise LinkError(f"link {self.address}: there is no host {host!r} ({error.strerror}); correct it") from None
        return socket.socket(family, kind), place


class UdpWire(Wire):
    """UDP. ``udpin`` listens and answers each peer where it sent from; ``udpout`` has one peer.

    The port is bound exclusively: two programs on one port would each hear some of the packets.
    """

    datagrams = True

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Bind, or choose a peer; see `Wire`."""
        self.close()
        made, place = self._socket(socket.SOCK_DGRAM)
        try:
            made.setblocking(False)
            made.bind(place) if self.many else made.connect(place)
        except OSError as error:
            made.close()
            raise self._failed(error) from None
        self._end = made

    def receive(self) -> tuple[bytes, Peer] | None:
        """One datagram; see `Wire`."""
        if self._end is None:
            return None
        try:
            data, peer = self._end.recvfrom(_DATAGRAM)
        except (BlockingIOError, InterruptedError, ConnectionError):
            return None  # ConnectionError: the peer's machine says nobody listens there; it may yet
        return data, peer

    def send(self, data: bytes, peer: Peer | None) -> bool:
        """One datagram; see `Wire`."""
        if self._end is None or (self.many and peer is None):
            return False
        try:
            return len(data) == (self._end.sendto(data, peer) if self.many else self._end.send(data))
        except OSError:
            return False


class TcpWire(Wire):
    """TCP. ``tcp`` dials, ``tcpin`` waits to be dialled, by one peer at a time."""

    def open(self, timeout_s: float = _DIAL_S) -> None:
        """Dial or listen; see `Wire`."""
        self._drop()
        if self._listener is not None:
            return
        made, place = self._socket(socket.SOCK_STREAM)
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
            raise self._failed(error) from None

    def _take(self, made: socket.socket) -> None:
        made.setblocking(False)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _WAITING)  # old commands must not queue up for seconds
        self._end, self._pending = made, b""

    def _read(self) -> bytes | None:
        if self._end is None and self._listener is not None:
            with contextlib.suppress(BlockingIOError, InterruptedError, ConnectionError):
                self._take(self._listener.accept()[0])
        return None if self._end is None else self._end.recv(_CHUNK)

    def _put(self, data: bytes) -> int | None:
        return self._end.send(data)


class SerialWire(Wire):
    """A serial port with one autopilot or radio at its end: 8 bits, no parity, no flow control."""

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
            self._end = serial.Serial(self.address.host, self.address.number, timeout=0, write_timeout=0)
        except OSError as error:  # SerialException is one; its text holds the system's
            if error.errno in _REMEDIES:
                raise self._failed(OSError(error.errno, os.strerror(error.errno or 0))) from None
            raise LinkError(f"link {self.address}: that is no serial port ({error}); name one") from None

    def _read(self) -> bytes | None:
        return None if self._end is None else self._end.read(_CHUNK) or None  # one that is gone raises

    def _put(self, data: bytes) -> int | None:
        return self._end.write(data)


def make_wire(address: Address) -> Wire:
    """The wire of an address, not yet open."""
    if address.kind == "serial":
        return SerialWire(address)
    return UdpWire(address) if address.kind.startswith("udp") else TcpWire(address)
