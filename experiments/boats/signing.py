"""MAVLink 2 signing on the boats' side."""

from __future__ import annotations

import time
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.exceptions import ConfigError

KEY_BYTES = 32
_EPOCH_S = 1_420_070_400
"""Signing time stamps count from 2015, in units of 10 us."""
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


def sign(mav: Any, key: bytes, link_id: int = 0) -> None:
    """Let a ``MAVLink`` object sign what it sends and check what it receives."""
    mav.signing.secret_key = key
    mav.signing.link_id = link_id
    mav.signing.timestamp = round((time.time() - _EPOCH_S) * 1e5)
    mav.signing.sign_outgoing = True


def accept_unsigned(mav: Any, message: int) -> bool:
    """Whether a packet without a valid signature is accepted nonetheless."""
    return message in _NEVER_SIGNED
