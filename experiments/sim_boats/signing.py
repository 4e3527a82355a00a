"""MAVLink 2 signing on the boats' side: what goes out is signed, what comes in must be."""

from __future__ import annotations

import hashlib
import hmac
import time
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.exceptions import ConfigError

KEY_BYTES = 32
_EPOCH_S = 1_420_070_400
"""Time stamps count from 2015, in units of 10 us."""
_NEW_STREAM_TICKS = 6_000_000
"""A sender not heard before may be this far behind, one minute."""
_MARKER, _SIGNED, _BLOCK = 0xFD, 1, 13
_NEVER_SIGNED = frozenset({mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_RADIO})
"""Messages of the radio itself, accepted unsigned."""


def check_key(key: bytes | None) -> bytes | None:
    """The key.

    Raises:
        ConfigError: it has another length.
    """
    if key is not None and len(key) != KEY_BYTES:
        raise ConfigError(f"the signing key has {len(key)} bytes; give {KEY_BYTES}")
    return key


def sign_outgoing(mav: Any, key: bytes) -> None:
    """Let a ``MAVLink`` object sign what it sends."""
    mav.signing.secret_key = key
    mav.signing.timestamp = _now()
    mav.signing.sign_outgoing = True


class Gate:
    """Lets signed packets in, each once and in order.

    Args:
        key: 32 bytes.
    """

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._latest = _now()
        self._streams: dict[bytes, int] = {}

    def admits(self, packet: bytes) -> bool:
        """Whether a packet may be read; one that may not leaves no trace."""
        if packet[0] != _MARKER:
            return packet[5] in _NEVER_SIGNED
        if not packet[2] & _SIGNED:
            return int.from_bytes(packet[7:10], "little") in _NEVER_SIGNED
        signature = hashlib.sha256(self._key + packet[:-6]).digest()[:6]
        if not hmac.compare_digest(signature, packet[-6:]):
            return False
        return self._is_new(packet[5:7] + packet[-_BLOCK : -_BLOCK + 1], int.from_bytes(packet[-12:-6], "little"))

    def _is_new(self, stream: bytes, ticks: int) -> bool:
        last = self._streams.get(stream, self._latest - _NEW_STREAM_TICKS)
        if ticks <= last:
            return False
        self._streams[stream] = ticks
        self._latest = max(self._latest, ticks)
        return True


def _now() -> int:
    return round((time.time() - _EPOCH_S) * 1e5)
