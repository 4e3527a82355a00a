"""MAVLink 2 signing: the key from a file only its owner reads, and checking what comes in.

The check is our own: a time stamp counts only once its signature has been verified, so that nobody without the key can
move a stream's time stamp ahead and lock the boat out.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import re
import stat
import time
from dataclasses import dataclass, field
from pathlib import Path

from ...exceptions import ConfigError

KEY_BYTES = 32
EPOCH_S = 1_420_070_400  # signing time stamps count from 1 January 2015
TICKS_PER_S = 100_000  # in units of 10 us
NEW_STREAM_S = 60.0  # a stream heard for the first time may be this much behind our clock

_SIGNED_FLAG = 0x01
_MARKER_2 = 0xFD
_BLOCK = 13
_SHORTEST_PASSPHRASE = 8
_LONGEST = 4096
_LIKE_DIGITS = 32  # so many hexadecimal digits and nothing else are meant as a key, not as a passphrase
_NOT_DIGITS = re.compile(r"[\s:,;_\-'\"\0\ufeff]")  # what keys are written with between and round their digits


@dataclass(frozen=True)
class Signing:
    """A key and the number of this link.

    Raises:
        ConfigError: the key has another length, or the number is out of range.
    """

    key: bytes = field(repr=False)  # 32 bytes; never shown
    link_id: int = 1  # 0 to 255

    def __post_init__(self) -> None:
        if len(self.key) != KEY_BYTES:
            raise ConfigError(f"the signing key has {len(self.key)} bytes; give {KEY_BYTES}")
        if not 0 <= self.link_id <= 255:
            raise ConfigError(f"signing link_id is {self.link_id}; give 0 to 255")


def read_key(path: str | Path) -> bytes:
    """The 32-byte key in a file: 64 hexadecimal digits, or a passphrase (its SHA-256, as ground stations do it).

    Args:
        path: of a regular file that belongs to this user and that nobody else may read or write.

    Raises:
        ConfigError: the file cannot be read, others can read or change it, or what is in it is no key.
    """
    path = Path(path)
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except (OSError, ValueError) as error:  # a path with a NUL in it is no path
        raise _unreadable(path, error) from None
    try:
        _check_safe(path, os.fstat(descriptor))  # of the opened file: what is checked is what is read
        content = os.read(descriptor, _LONGEST + 1)
    except OSError as error:
        raise _unreadable(path, error) from None
    finally:
        os.close(descriptor)
    return _parse_key(path, content)


def _unreadable(path: Path, error: Exception) -> ConfigError:
    why = getattr(error, "strerror", None) or error
    return ConfigError(f"cannot read the signing key {str(path)!r} ({why}); give the path of a key file")


def _check_safe(path: Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise ConfigError(f"the signing key {path} is no plain file; give the path of a key file")
    if not hasattr(os, "geteuid"):  # not a Unix: modes and owners say nothing there
        return
    if status.st_mode & 0o077:
        raise ConfigError(
            f"the signing key {path} can be read or changed by others (mode {stat.S_IMODE(status.st_mode):04o}); "
            f"run: chmod 600 {path}"
        )
    if status.st_uid != os.geteuid():
        raise ConfigError(f"the signing key {path} belongs to another user; make a copy of your own, mode 600")


def _parse_key(path: Path, content: bytes) -> bytes:
    try:
        text = content.decode("utf-8").strip()
    except UnicodeDecodeError:
        text = ""
    if re.fullmatch(r"[0-9a-fA-F]{64}", text):
        return bytes.fromhex(text)
    digits = _NOT_DIGITS.sub("", text.casefold().removeprefix("0x"))
    if len(digits) >= _LIKE_DIGITS and re.fullmatch(r"[0-9a-f]+", digits):
        raise ConfigError(
            f"the signing key {path} looks like hexadecimal digits, {len(digits)} of them, but is not just 64; write "
            "64 digits and nothing else, or a passphrase that nobody takes for digits"
        )
    if len(text) < _SHORTEST_PASSPHRASE or len(content) > _LONGEST or not text.isprintable():
        raise ConfigError(
            f"the signing key {path} holds neither 64 hexadecimal digits nor one line of passphrase of at least "
            f"{_SHORTEST_PASSPHRASE} characters; write one of them, the same as on the boats"
        )
    return hashlib.sha256(text.encode()).digest()


class SigningClock:
    """Time stamps for signing: they only go forward, whatever the wall clock does, and never fall behind a boat's."""

    def __init__(self) -> None:
        self._start_ticks = round((time.time() - EPOCH_S) * TICKS_PER_S)
        self._start_s = time.monotonic()
        self._last = 0

    def now(self) -> int:
        """Present time stamp, not used up."""
        return max(self._last, self._start_ticks + round((time.monotonic() - self._start_s) * TICKS_PER_S))

    def take(self) -> int:
        """A time stamp later than all before."""
        self._last = max(self.now(), self._last + 1)
        return self._last

    def hear(self, ticks: int) -> None:
        """A verified time stamp of somebody else's: ours must not be behind it."""
        self._last = max(self._last, ticks)


class SignatureCheck:
    """Verifies frames with one key; each sender's time stamps must rise."""

    def __init__(self, key: bytes, clock: SigningClock) -> None:
        self._key = key
        self._clock = clock
        self._latest: dict[tuple[int, int, int], int] = {}

    def refuse(self, frame: bytes) -> str:
        """Why a whole frame must not be believed; empty when it is signed rightly and new.

        Returns:
            "", "unsigned", "bad_signature", "replayed" or "old_signature".
        """
        if frame[0] != _MARKER_2 or not frame[2] & _SIGNED_FLAG:
            return "unsigned"
        expected = hashlib.sha256(self._key + frame[:-6]).digest()[:6]
        if not hmac.compare_digest(expected, frame[-6:]):
            return "bad_signature"
        stream, ticks = (frame[-_BLOCK], frame[5], frame[6]), int.from_bytes(frame[-12:-6], "little")
        latest = self._latest.get(stream)
        if latest is None:
            if ticks < self._clock.now() - round(NEW_STREAM_S * TICKS_PER_S):
                return "old_signature"
        elif ticks <= latest:
            return "replayed"
        self._latest[stream] = ticks
        self._clock.hear(ticks)
        return ""
