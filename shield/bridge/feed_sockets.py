"""Opening the feed's UDP sockets, and telling which hosts may speak."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence

from ..exceptions import BridgeError, ConfigError

Network = ipaddress.IPv4Network | ipaddress.IPv6Network

BUFFER_BYTES = 1 << 18
"""What the kernel keeps for us: a fraction of a second of a flood, not more."""
WAKE_S = 0.2
"""A hearing socket gives up waiting this often, to see whether it is to close."""


def socket_address(text: str) -> tuple[str, int]:
    """Host and port of HOST:PORT; an IPv6 host may stand in brackets.

    Raises:
        ConfigError: it is not of that form.
    """
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isdecimal() or int(port) > 65535:
        raise ConfigError(f'{text!r} is no address; give "HOST:PORT", such as "127.0.0.1:14700"')
    return host, int(port)


def ip_version(host: str) -> int:
    """4 or 6; names, such as localhost, count as 4."""
    return 6 if ":" in host else 4


def hearing_socket(listen: str) -> socket.socket:
    """A UDP socket bound to HOST:PORT.

    Raises:
        BridgeError: it cannot be bound.
        ConfigError: ``listen`` is no address.
    """
    host, port = socket_address(listen)
    opened = socket.socket(_family(ip_version(host)), socket.SOCK_DGRAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        opened.settimeout(WAKE_S)
        opened.bind((host, port))
    except OSError as error:
        opened.close()
        raise BridgeError(
            f"cannot hear the feed at {listen} ({error.strerror or error}); end the program that uses the port, or "
            "give another address"
        ) from None
    return opened


def sending_socket(version: int) -> socket.socket:
    """A UDP socket that never waits."""
    opened = socket.socket(_family(version), socket.SOCK_DGRAM)
    opened.setblocking(False)
    return opened


def numeric_host(host: str) -> str:
    """An address as numbers, looked up once: looking it up for each packet could wait for a name server.

    Raises:
        ConfigError: nobody knows the name.
    """
    try:
        found = socket.getaddrinfo(host, None, _family(ip_version(host)), socket.SOCK_DGRAM)
    except OSError as error:
        raise ConfigError(f"nobody knows the host {host!r} ({error.strerror}); give its address") from None
    return str(found[0][4][0])


def network_of(host: str) -> Network:
    """The network of hosts that may speak: an address, a network such as 192.168.1.0/24, or "localhost".

    Raises:
        ConfigError: it is none of these.
    """
    try:
        return ipaddress.ip_network("127.0.0.1" if host == "localhost" else host, strict=False)
    except ValueError:
        raise ConfigError(f"{host!r} is no host to allow; give an address such as 127.0.0.1, or a network") from None


def is_among(host: str, networks: Sequence[Network]) -> bool:
    """Whether an address lies in any of the networks."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return False
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped  # IPv4 heard on a socket that hears both
    return any(address in network for network in networks)


def _family(version: int) -> socket.AddressFamily:
    return socket.AF_INET6 if version == 6 else socket.AF_INET
