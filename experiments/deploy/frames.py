"""Messages over pipes between the runner and the policy's process: a length, then that many bytes.

The runner's ends never wait: what does not fit now is kept for the next turn, and half a message is no message yet.
"""

from __future__ import annotations

import contextlib
import os
import struct

HEAD = struct.Struct("<I")
MAX_BYTES = 1 << 20
"""A longer message is nothing either side sends."""


GONE = "the other end is gone"


class Broken(Exception):
    """The other end is gone, or sent what is no message."""


class FrameReader:
    """Takes messages out of a pipe without waiting.

    Args:
        descriptor: the pipe's end, closed by `close`.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._buffer = bytearray()

    def read(self) -> list[bytes]:
        """Whole messages that have come.

        Raises:
            Broken: the other end is gone and all it sent was read, or what it sends is no message.
        """
        ended = self._fill()
        messages = []
        while len(self._buffer) >= HEAD.size:
            (length,) = HEAD.unpack_from(self._buffer)
            if length > MAX_BYTES:
                raise Broken(f"a message of {length} bytes")
            if len(self._buffer) < HEAD.size + length:
                break
            messages.append(bytes(self._buffer[HEAD.size : HEAD.size + length]))
            del self._buffer[: HEAD.size + length]
        if ended and not messages:
            raise Broken(GONE)
        return messages

    @property
    def is_clear(self) -> bool:
        """Whether no part of a message is waiting for its rest."""
        return not self._buffer

    def close(self) -> None:
        """Give the pipe's end back."""
        os.close(self._descriptor)

    def _fill(self) -> bool:
        """Read what is there, no more than a message at most; whether the other end is gone."""
        while len(self._buffer) <= MAX_BYTES:
            try:
                data = os.read(self._descriptor, 1 << 16)
            except BlockingIOError:
                return False
            if not data:
                return True
            self._buffer += data
        return False


class FrameWriter:
    """Puts messages into a pipe without waiting.

    Args:
        descriptor: the pipe's end, closed by `close`.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._left = b""

    @property
    def is_clear(self) -> bool:
        """Whether everything written so far is in the pipe."""
        return not self._left

    def write(self, message: bytes) -> None:
        """Send a message after those before it.

        Raises:
            Broken: the other end is gone.
        """
        self._left += HEAD.pack(len(message)) + message
        self.flush()

    def flush(self) -> None:
        """Put into the pipe what did not fit before.

        Raises:
            Broken: the other end is gone.
        """
        with contextlib.suppress(BlockingIOError):
            while self._left:
                try:
                    sent = os.write(self._descriptor, self._left)
                except BrokenPipeError:
                    raise Broken(GONE) from None
                self._left = self._left[sent:]

    def close(self) -> None:
        """Give the pipe's end back."""
        os.close(self._descriptor)


def read_message(descriptor: int) -> bytes | None:
    """The next message, waiting for it; None when the other end is gone. For the policy's process."""
    head = _read_exactly(descriptor, HEAD.size)
    if head is None:
        return None
    (length,) = HEAD.unpack(head)
    return _read_exactly(descriptor, length)


def write_message(descriptor: int, message: bytes) -> None:
    """Send a message, waiting until it is in the pipe. For the policy's process."""
    data = HEAD.pack(len(message)) + message
    while data:
        data = data[os.write(descriptor, data) :]


def _read_exactly(descriptor: int, length: int) -> bytes | None:
    data = b""
    while len(data) < length:
        more = os.read(descriptor, length - len(data))
        if not more:
            return None
        data += more
    return data
