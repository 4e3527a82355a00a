"""`Seal`: a keyed code at the end of each packet of the feed, so that nobody without the key can speak on it.

A sealed packet is the JSON object, a line break, ``hmac-sha256:`` and the HMAC-SHA256 of the object's bytes in 64
hexadecimal digits. Its key is made from the signing key for this purpose alone:
``HMAC-SHA256(signing key, "steerclear feed 1")``.
"""

from __future__ import annotations

import hmac

from ..exceptions import ConfigError

KEY_BYTES = 32
PURPOSE = b"steerclear feed 1"
_MARK = b"\nhmac-sha256:"
_DIGITS = 64
SEAL_BYTES = len(_MARK) + _DIGITS


class Seal:
    """Closes packets and tells genuine ones.

    Args:
        key: the 32-byte signing key, as `mavlink.signing.read_key` gives it.

    Raises:
        ConfigError: the key has another length.
    """

    def __init__(self, key: bytes) -> None:
        if len(key) != KEY_BYTES:
            raise ConfigError(f"the signing key has {len(key)} bytes; give {KEY_BYTES}")
        self._key = hmac.digest(key, PURPOSE, "sha256")

    def close(self, body: bytes) -> bytes:
        """The body with its code."""
        return body + _MARK + self._code(body)

    def fault(self, data: bytes) -> str:
        """Why a datagram must not be believed: "unsigned", "bad_signature", or empty when it is genuine."""
        if not is_sealed(data):
            return "unsigned"
        return "" if hmac.compare_digest(self._code(body_of(data)), data[-_DIGITS:]) else "bad_signature"

    def _code(self, body: bytes) -> bytes:
        return hmac.digest(self._key, body, "sha256").hex().encode()


def is_sealed(data: bytes) -> bool:
    """Whether a datagram ends as sealed ones do."""
    return len(data) >= SEAL_BYTES and data[-SEAL_BYTES:-_DIGITS] == _MARK


def body_of(data: bytes) -> bytes:
    """A sealed datagram without its code."""
    return data[:-SEAL_BYTES]
