"""Sockets of simulated boats, never blocking, and which boat is behind which of them."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
import time
from collections.abc import Callable, Iterator
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.feed_sender import socket_address
from steerclear.shield.bridge.fleet_checks import MOOS
from steerclear.shield.exceptions import ConfigError

from .boat import Boat
from .moos import Community

_V1, _V2 = 0xFE, 0xFD
_V1_FRAMING, _V2_FRAMING, _SIGNATURE = 8, 12, 13
_SIGNED = 1


def _target_offsets() -> dict[int, int]:
    """Byte of ``target_system`` within the payload, by message."""
    offsets = {}
    sizes = {"char": 1, "uint8_t": 1, "int8_t": 1, "uint16_t": 2, "int16_t": 2, "uint32_t": 4, "int32_t": 4}
    sizes |= {"float": 4, "uint64_t": 8, "int64_t": 8, "double": 8}
    for number, kind in mavlink.mavlink_map.items():
        if "target_system" not in kind.ordered_fieldnames:
            continue
        offset = 0
        for name, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
            if name == "target_system":
                break
            offset += sizes[kind.fieldtypes[kind.fieldnames.index(name)]] * max(1, length)
        offsets[number] = offset
    return offsets


TARGET_OFFSETS = _target_offsets()


class FrameCutter:
    """Cuts the bytes of one sender into packets; bytes that are none are skipped."""

    def __init__(self) -> None:
        self._kept = bytearray()

    def cut(self, data: bytes) -> Iterator[bytes]:
        """Whole packets so far; a rest is kept for the next call."""
        kept = self._kept
        kept += data
        start = 0
        while start < len(kept):
            if kept[start] not in (_V1, _V2):
                start += 1
                continue
            size = packet_size(kept, start)
            if size == 0 or start + size > len(kept):
                break
            yield bytes(kept[start : start + size])
            start += size
        del kept[:start]


def packet_size(data: bytes | bytearray, start: int = 0) -> int:
    """Bytes of the packet that begins there; 0 when its header is not complete."""
    if len(data) - start < 3:
        return 0
    if data[start] == _V1:
        return data[start + 1] + _V1_FRAMING
    return data[start + 1] + _V2_FRAMING + (_SIGNATURE if data[start + 2] & _SIGNED else 0)


def target_of(packet: bytes) -> int:
    """System a whole packet is for; 0 for all."""
    if packet[0] == _V1:
        number, header = packet[5], 6
    else:
        number, header = int.from_bytes(packet[7:10], "little"), 10
    offset = TARGET_OFFSETS.get(number)
    if offset is None or offset >= packet[1]:  # trailing zeros of a payload are left out
        return 0
    return packet[header + offset]


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


LOOPBACK, ANY = "127.0.0.1", "0.0.0.0"


class Wire(Protocol):
    """One end of a link. ``address`` is what the runner's side opens."""

    address: str

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on."""

    def read(self) -> Iterator[bytes]:
        """Whole packets that have come in."""

    def write(self, packet: bytes) -> None:
        """Send to whoever is there; what cannot be sent is lost."""

    def close(self) -> None:
        """Give the sockets back."""


def split_address(address: str, allow_remote: bool = False) -> tuple[str, str, int]:
    """Kind, host and port of a link's address.

    Raises:
        ConfigError: no such kind, no port, or a host beyond this machine without ``allow_remote``.
    """
    kind, _, rest = address.partition(":")
    host, _, port = rest.rpartition(":")
    if kind == "udp":
        kind = "udpin"  # what pymavlink makes of it
    if kind not in _WIRES or not port.isdecimal() or not int(port) < 65536:
        raise ConfigError(f"cannot simulate a boat at {address!r}; give udpin, udpout, tcp or tcpin:HOST:PORT")
    host = LOOPBACK if host in ("", "localhost", ANY) else host
    if not (allow_remote or is_loopback(host)):
        raise ConfigError(f"{address!r} is not on this machine; simulated boats stay on 127.0.0.1 unless told")
    return kind, host, int(port)


def is_loopback(host: str) -> bool:
    """Whether a host is this machine."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def open_wire(address: str, allow_remote: bool = False) -> Wire:
    """The other end of the link that a runner opens at ``address``.

    Raises:
        ConfigError: an address that cannot be used, or a port that is taken.
    """
    kind, host, port = split_address(address, allow_remote)
    try:
        return _WIRES[kind](host, port)
    except OSError as error:
        raise ConfigError(f"cannot open {address} ({error.strerror or error}); choose a free port") from None


_WIRES: dict[str, Callable[[str, int], Wire]] = {
    "udpin": UdpCaller,
    "udpout": UdpListener,
    "tcp": TcpListener,
    "tcpin": TcpCaller,
}


_FREE_PORT = "udpout:127.0.0.1:0"


def near(address: str, allow_remote: bool) -> str:
    """HOST:PORT of a listener, which must be on this machine without ``allow_remote``.

    Raises:
        ConfigError: it is elsewhere, or of another form.
    """
    host, port = socket_address(address)
    if host == ANY:
        return f"{LOOPBACK}:{port}"
    if not (allow_remote or is_loopback(host)):
        raise ConfigError(f"{address!r} is not on this machine; simulated boats stay on 127.0.0.1 unless told")
    return address


class Ports:
    """The wires of all boats. Boats of one address share its wire, but each calls over UDP from a port of its own.

    Args:
        allow_remote: whether links may leave this machine.
    """

    def __init__(self, allow_remote: bool) -> None:
        self._allow_remote = allow_remote
        self._shared: dict[str, Wire] = {}
        self._aboard: dict[Wire, list[Boat]] = {}
        self._communities: dict[str, Community] = {}

    @property
    def addresses(self) -> dict[str, str]:
        """Address to open for each boat with a link."""
        wired = {boat.spec.name: wire.address for wire, aboard in self._aboard.items() for boat in aboard}
        return wired | {name: f"{MOOS}127.0.0.1:{aboard.db.port}" for name, aboard in self._communities.items()}

    def plug_in(self, boat: Boat) -> None:
        """Open a boat's link, if it has one.

        Raises:
            ConfigError: the address or system id cannot be used.
        """
        address = boat.spec.address
        if address is None:
            return
        if boat.community is not None:
            self._communities[boat.spec.name] = boat.community
            return
        if not 1 <= boat.system_id <= 255:
            raise ConfigError(f"boat {boat.spec.name!r} has system id {boat.system_id}; give one of 1..255")
        wire = self._wire(address)
        aboard = self._aboard[wire]
        if any(other.system_id == boat.system_id for other in aboard):
            raise ConfigError(f"two boats on {address} have system id {boat.system_id}; give each one of its own")
        boat.write = wire.write
        aboard.append(boat)

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on."""
        return [entry for wire in self._aboard for entry in wire.sockets()]

    def receive(self, now_s: float) -> None:
        """Hand what came in to the boats it is for."""
        for wire, aboard in self._aboard.items():
            for packet in wire.read():
                target = target_of(packet)
                for boat in aboard:
                    if target in (0, boat.system_id):
                        boat.hear(packet, now_s)

    def close(self) -> None:
        """Give the sockets back."""
        for wire in self._aboard:
            wire.close()
        for community in self._communities.values():
            community.close()

    def _wire(self, address: str) -> Wire:
        if address in self._shared:
            return self._shared[address]
        wire = open_wire(address or _FREE_PORT, self._allow_remote)
        self._aboard[wire] = []
        if address and not wire.address.startswith("udpin"):
            self._shared[address] = wire
        return wire
