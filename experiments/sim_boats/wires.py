"""Links of simulated boats: the runner's transport and framing with the ends swapped, and the boats behind each."""

from __future__ import annotations

import contextlib
import ipaddress
import time
from collections.abc import Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.feed_packets import socket_address
from steerclear.shield.bridge.fleet_checks import MOOS
from steerclear.shield.bridge.mavlink.framing import Framer
from steerclear.shield.bridge.mavlink.transport import Address, Peer, make_wire, parse_address, place_text
from steerclear.shield.exceptions import ConfigError, LinkError

from .boat import Boat
from .moos import LOOPBACK

FREE_PORT = f"udpout:{LOOPBACK}:0"
OTHER_END = {"udpin": "udpout", "udpout": "udpin", "tcp": "tcpin", "tcpin": "tcp"}
"""What a boat opens for each kind of address on the runner's side."""
MOST_PEERS = 8  # a listening boat answers at most this many peers, those heard last
REDIAL_S, DIAL_S = 0.5, 0.2


def near(address: str, allow_remote: bool) -> str:
    """Return HOST:PORT of a listener; `ConfigError` where it is malformed, or elsewhere without ``allow_remote``."""
    host, port = socket_address(address)
    return place_text(_near_host(host, address, allow_remote), port)


def _near_host(host: str, address: str, allow_remote: bool) -> str:
    if host in ("localhost", "0.0.0.0"):
        return LOOPBACK
    with contextlib.suppress(ValueError):
        allow_remote = allow_remote or ipaddress.ip_address(host).is_loopback
    if allow_remote:
        return host
    raise ConfigError(f"{address!r} is not on this machine; simulated boats stay on {LOOPBACK} unless told")


class BoatWire:
    """The boats' end of one link; never blocks. ``address`` is what the runner opens, with the chosen port.

    Raises:
        ConfigError: it cannot be opened.
    """

    def __init__(self, address: Address) -> None:
        self._wire = make_wire(Address(OTHER_END[address.kind], address.host, address.number))
        self._framers: dict[Peer, Framer] = {}
        self._dial_s = 0.0
        self.aboard: list[Boat] = []
        if address.kind != "tcpin":  # a boat that connects keeps trying
            try:
                self._wire.open()
            except LinkError as error:
                raise ConfigError(f"simulated boat at {address}: {error}") from None
        listens = address.kind in ("udpout", "tcp")
        self.address = str(Address(address.kind, address.host, self._wire.port if listens else address.number))

    def fileno(self) -> int:
        """Return the descriptor to wait on; -1: not open."""
        return self._wire.fileno()

    def read(self) -> Iterator[bytes]:
        """Yield complete frames received."""
        if self._wire.fileno() < 0 and time.monotonic() >= self._dial_s:
            self._dial_s = time.monotonic() + REDIAL_S
            with contextlib.suppress(LinkError):
                self._wire.open(DIAL_S)
        try:
            while (received := self._wire.receive()) is not None:
                data, peer = received
                framer = self._framers.pop(peer, None) or Framer(self._wire.datagrams)
                self._framers[peer] = framer  # the latest peer is last
                while len(self._framers) > MOST_PEERS:
                    del self._framers[next(iter(self._framers))]
                yield from framer.feed(data)
        except OSError:  # the other end is gone; another may connect
            self._framers.clear()

    def write(self, packet: bytes) -> None:
        """Send to all known peers; what cannot be sent is lost."""
        for peer in list(self._framers) if self._wire.many else (None,):
            self._wire.send(packet, peer)

    def close(self) -> None:
        """Close the socket."""
        self._wire.close()
        self._dial_s = float("inf")


class Ports:
    """The wires of all boats, and the address to open for each.

    Boats at one address share its wire, except that each boat sending to the runner's UDP port has its own socket.
    """

    def __init__(self, allow_remote: bool) -> None:
        self._allow_remote = allow_remote
        self.addresses: dict[str, str] = {}
        self._shared: dict[str, BoatWire] = {}
        self._wires: list[BoatWire] = []
        self._reader = mavlink.MAVLink(None)

    def plug_in(self, boat: Boat) -> None:
        """Open a boat's link, if it has one; `ConfigError` where its address or system id cannot be used."""
        address, name = boat.spec.address, boat.spec.name
        if address is None:
            return
        if boat.community is not None:
            self.addresses[name] = f"{MOOS}{LOOPBACK}:{boat.community.db.port}"
            return
        if not 1 <= boat.system_id <= 255:
            raise ConfigError(f"boat {name!r} has system id {boat.system_id}; give one of 1..255")
        wire = self._shared.get(address) or self._open(address)
        if any(other.system_id == boat.system_id for other in wire.aboard):
            raise ConfigError(f"two boats on {address} have system id {boat.system_id}; give each one of its own")
        boat.write, self.addresses[name] = wire.write, wire.address
        wire.aboard.append(boat)

    def sockets(self) -> list[int]:
        """Return the descriptors to wait on."""
        return [number for wire in self._wires if (number := wire.fileno()) >= 0]

    def receive(self, now_s: float) -> None:
        """Deliver received packets to the addressed boats."""
        for wire in self._wires:
            for packet in wire.read():
                target = self._target_of(packet)
                for boat in wire.aboard:
                    if target in (0, boat.system_id):
                        boat.hear(packet, now_s)

    def close(self) -> None:
        """Close the sockets."""
        for wire in self._wires:
            wire.close()

    def _target_of(self, packet: bytes) -> int:
        """Return the addressed system of a frame; 0: all, or not decodable, which each boat checks itself."""
        try:
            return int(getattr(self._reader.decode(bytearray(packet)), "target_system", 0))
        except Exception:  # a decoder error on hostile bytes must not stop the boats
            return 0

    def _open(self, address: str) -> BoatWire:
        try:
            found = parse_address(address or FREE_PORT)
        except LinkError as error:
            raise ConfigError(f"cannot simulate a boat at {address!r}: {error}") from None
        if found.kind not in OTHER_END:
            raise ConfigError(f"cannot simulate a boat at {address!r}; give udpin, udpout, tcp or tcpin:HOST:PORT")
        wire = BoatWire(Address(found.kind, _near_host(found.host, address, self._allow_remote), found.number))
        self._wires.append(wire)
        if address and found.kind != "udpin":
            self._shared[address] = wire
        return wire
