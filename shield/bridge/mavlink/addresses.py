"""Link addresses: what FLEET.yaml's ``address`` says."""

from __future__ import annotations

from dataclasses import dataclass

from ...exceptions import LinkError

NETWORK_KINDS = ("udpin", "udpout", "tcp", "tcpin")
KINDS = (*NETWORK_KINDS, "serial")
DEFAULT_BAUD = 57_600


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
    if kind == "serial":
        if not (colon and number.isascii() and number.isdigit()):
            host, number = rest, str(DEFAULT_BAUD)
        return Address(kind, host, int(number))
    if not host or not number.isascii() or not number.isdigit() or not 0 <= int(number) <= 65535:
        raise LinkError(
            f"link address {text!r} has no host and port; give {kind}:HOST:PORT, such as {kind}:127.0.0.1:14550"
        )
    return Address(kind, host.strip("[]"), int(number))
