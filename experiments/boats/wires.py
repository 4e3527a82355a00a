"""Sockets of simulated boats: UDP and TCP, as listener or as caller, never blocking."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
from collections.abc import Callable, Iterator
from typing import Protocol

from steerclear.shield.exceptions import ConfigError

from .tcp import TcpCaller, TcpListener
from .udp import UdpCaller, UdpListener

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
