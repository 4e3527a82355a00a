"""From bytes to whole MAVLink frames with a right checksum; damage never swallows the frames around it."""

from __future__ import annotations

import re

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_MARKERS = re.compile(b"[\xfd\xfe]")
_MARKER_2 = 0xFD
_HEADER = {0xFD: 10, 0xFE: 6}
_CHECKSUM = 2
_SIGNATURE = 13
_SIGNED_FLAG = 0x01

_SHORT = -1
_BAD = -2


class Framer:
    """Cuts what one sender sends into frames.

    Where bytes come as datagrams, which normally hold whole frames, a frame never waits for the rest of a damaged one.

    Attributes:
        damaged: places where a frame began and its checksum or flags were wrong.
        unknown: frames of messages this dialect does not have.
    """

    def __init__(self, datagrams: bool) -> None:
        self._datagrams = datagrams
        self._rest = b""
        self._end = 0  # where the frame before ended, in what comes next
        self.damaged = 0
        self.unknown = 0

    def feed(self, data: bytes) -> list[bytes]:
        """The whole frames these bytes complete, in order."""
        if self._datagrams and self._rest and _measure(data, 0, False) > 0:
            self._rest = b""
            self.damaged += 1
        buffer = self._rest + data
        frames: list[bytes] = []
        at, kept, end = 0, -1, self._end
        while (found := _MARKERS.search(buffer, at)) is not None:
            at = found.start()
            length = _measure(buffer, at, at == end)
            if length > 0:
                self._keep(buffer[at : at + length], frames)
                end = at = at + length
                kept = -1
                continue
            if length == _SHORT:
                kept = at if kept < 0 else kept
                if not self._datagrams:
                    break
            else:
                self.damaged += 1
            at += 1
        self._rest = buffer[kept:] if kept >= 0 else b""
        self._end = 0 if self._datagrams or kept == end or end == len(buffer) else -1
        return frames

    def _keep(self, frame: bytes, frames: list[bytes]) -> None:
        if message_id(frame) in mavlink.mavlink_map:
            frames.append(frame)
        else:
            self.unknown += 1


def message_id(frame: bytes) -> int:
    """Number of the message in a whole frame."""
    return int.from_bytes(frame[7:10], "little") if frame[0] == _MARKER_2 else frame[5]


def source(frame: bytes) -> tuple[int, int]:
    """System and component a whole frame says it is from."""
    return (frame[5], frame[6]) if frame[0] == _MARKER_2 else (frame[3], frame[4])


def _measure(buffer: bytes, at: int, follows: bool) -> int:
    """Length of the right frame that begins here; `_SHORT` when its end is not there yet, `_BAD` when it is none.

    Args:
        buffer: bytes.
        at: where a marker is.
        follows: a frame ended just before: only there an unknown message is taken for one, whose checksum nobody knows.
    """
    if len(buffer) - at < 3:
        return _SHORT if len(buffer) > at and buffer[at] in _HEADER else _BAD
    header = _HEADER.get(buffer[at])
    if header is None:
        return _BAD
    signed = 0
    if buffer[at] == _MARKER_2:
        if buffer[at + 2] & ~_SIGNED_FLAG:
            return _BAD
        signed = _SIGNATURE if buffer[at + 2] else 0
    length = header + buffer[at + 1] + _CHECKSUM + signed
    if len(buffer) - at < length:
        return _SHORT
    kind = mavlink.mavlink_map.get(message_id(buffer[at : at + 10]))
    if kind is None:
        return _measure_unknown(buffer, at + length, length) if follows else _BAD
    covered = at + header + buffer[at + 1]
    checksum = mavlink.x25crc(buffer[at + 1 : covered])
    checksum.accumulate(bytes([kind.crc_extra]))
    return length if checksum.crc == int.from_bytes(buffer[covered : covered + _CHECKSUM], "little") else _BAD


def _measure_unknown(buffer: bytes, end: int, length: int) -> int:
    """Length of a frame whose checksum nobody knows: nothing follows it, or a right frame does."""
    if end == len(buffer):
        return length
    after = _measure(buffer, end, False)
    return length if after > 0 else after
