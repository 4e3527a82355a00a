"""Which boat is behind which socket, and handing packets to the boats they are for."""

from __future__ import annotations

import socket

from steerclear.shield.bridge.feed_sender import socket_address
from steerclear.shield.bridge.fleet_checks import MOOS
from steerclear.shield.exceptions import ConfigError

from .boat import Boat
from .frames import target_of
from .moos import Community
from .wires import ANY, LOOPBACK, Wire, is_loopback, open_wire

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
