"""The bytes between a MOOS client and a MOOSDB: pure functions, no sockets.

A client opens with `PROTOCOL`. After that both sides send packets: a header of 9 bytes (length of all, number of
messages, a flag that is always 0), then the messages. Integers are 32 bits, floats 64, little-endian; a string is its
number of bytes and the bytes. Texts are read as latin-1, so every byte survives.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from dataclasses import dataclass

from ...exceptions import LinkError

PROTOCOL = b"ELKS CAN'T DANCE 2/8/10".ljust(32, b"\0")
"""What a client sends before anything else, in one piece with its hello."""

HEADER_BYTES, FIXED_BYTES = 9, 54  # of a packet's header, and of a message without its five strings

MOST_BYTES = 1 << 22  # no packet may be longer: a MOOSDB itself would take any length it is told

DATA, WELCOME, POISON, NOTIFY, REGISTER, UNREGISTER = "i", "W", "K", "N", "R", "U"
TIMING = "T"
DOUBLE, STRING = "D", "S"
TIMING_KEY = "_async_timing"

_HEADER = struct.Struct("<iib")
_START = struct.Struct("<ii2s")
_LENGTH = struct.Struct("<i")
_NUMBERS = struct.Struct("<ddd")


class WireError(LinkError):
    """Bytes that no MOOS client or MOOSDB sends."""


@dataclass(frozen=True, slots=True)
class Message:
    """One MOOS message."""

    kind: str  # one letter, such as `NOTIFY`
    key: str = ""  # name of the variable
    data: str = DOUBLE  # `DOUBLE` or `STRING`; other letters are of no use to us
    source: str = ""  # name of the client that posted it; a MOOSDB acts for the client named here
    time_s: float = -1.0  # when the value was valid, s of MOOS time
    value: float = -1.0  # of a double; -1 otherwise
    text: str = ""  # of a string
    value2: float = -1.0  # mostly -1
    source_aux: str = ""  # further source, origin and id
    community: str = ""
    number: int = -1


def notify(key: str, value: float | str, source: str, time_s: float) -> Message:
    """A post of a variable.

    Raises:
        WireError: a number or time that is not finite: no consumer of MOOS survives one.
    """
    if isinstance(value, str):
        return Message(NOTIFY, key, STRING, source, time_s, text=value)
    if not (math.isfinite(value) and math.isfinite(time_s)):
        raise WireError(f"{key} was to be posted as {value} at {time_s}; post finite numbers only")
    return Message(NOTIFY, key, DOUBLE, source, time_s, float(value))


def register(key: str, source: str, time_s: float, period_s: float = 0.0) -> Message:
    """A subscription to a variable, every write or at most one in ``period_s`` of MOOS time."""
    return Message(REGISTER, key, DOUBLE, source, time_s, period_s)


def hello(name: str, time_s: float) -> Message:
    """What an asynchronous client introduces itself with."""
    return Message(DATA, "asynchronous", STRING, time_s=time_s, text=name)


def timing(time_s: float) -> Message:
    """A heartbeat; must be the first message of its packet."""
    return Message(TIMING, TIMING_KEY, time_s=time_s, value=0.0)


def pack_message(message: Message) -> bytes:
    """A message's bytes: also what a pShare datagram holds."""
    strings = (message.source, message.source_aux, message.community, message.key)
    parts = [part for text in strings for part in _packed(text)]
    numbers = _NUMBERS.pack(message.time_s, message.value, message.value2)
    body = b"".join([*parts, numbers, *_packed(message.text)])
    letters = (message.kind + message.data).encode("latin-1")
    return _START.pack(_START.size + len(body), message.number, letters) + body


def pack_packet(messages: Iterable[Message]) -> bytes:
    """A packet's bytes.

    Raises:
        WireError: it has no message, or is longer than `MOST_BYTES`.
    """
    packed = [pack_message(message) for message in messages]
    length = HEADER_BYTES + sum(map(len, packed))
    if not packed or length > MOST_BYTES:
        raise WireError(f"a packet of {len(packed)} messages and {length} bytes; send 1 or more, {MOST_BYTES} at most")
    return _HEADER.pack(length, len(packed), 0) + b"".join(packed)


def unpack_message(data: bytes, start: int = 0) -> tuple[Message, int]:
    """The message that begins at ``start``, and where it ends.

    Raises:
        WireError: its lengths contradict each other or the bytes there are.
    """
    if len(data) - start < FIXED_BYTES:
        raise WireError(f"a message begins {len(data) - start} bytes before the end, shorter than {FIXED_BYTES}")
    length, number, letters = _START.unpack_from(data, start)
    end = start + length
    if length < FIXED_BYTES or end > len(data):
        raise WireError(f"a message says it has {length} bytes; {len(data) - start} are there")
    place = start + _START.size
    texts = []
    for _ in range(4):
        text, place = _string(data, place, end)
        texts.append(text)
    if place + _NUMBERS.size > end:
        raise WireError("a message's strings leave no room for its numbers")
    time_s, value, value2 = _NUMBERS.unpack_from(data, place)
    text, place = _string(data, place + _NUMBERS.size, end)
    if place != end:
        raise WireError(f"a message says it has {length} bytes and its parts have {place - start}")
    kind, kind_of_data = letters.decode("latin-1")
    source, aux, community, key = texts
    return Message(kind, key, kind_of_data, source, time_s, value, text, value2, aux, community, number), end


def unpack_packet(data: bytes) -> list[Message]:
    """The messages of a whole packet.

    Raises:
        WireError: it is damaged.
    """
    length, count, flag = _HEADER.unpack_from(data) if len(data) >= HEADER_BYTES else (0, 0, 0)
    if length != len(data) or flag != 0 or not 0 <= count * FIXED_BYTES <= length:
        raise WireError(f"a packet of {len(data)} bytes says {length} bytes, {count} messages, compression {flag}")
    messages, place = [], HEADER_BYTES
    for _ in range(count):
        message, place = unpack_message(data, place)
        messages.append(message)
    if place != length:
        raise WireError(f"{length - place} bytes are left over after a packet's {count} messages")
    return messages


class PacketReader:
    """Cuts a stream of bytes into packets; never holds more than one packet and what came with it."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[list[Message]]:
        """Take bytes in; the messages of every packet that is whole now.

        Raises:
            WireError: the stream is damaged; nothing after this can be trusted, close it.
        """
        self._buffer += data
        packets = []
        while len(self._buffer) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._buffer)
            if not HEADER_BYTES <= length <= MOST_BYTES:
                raise WireError(f"a packet says it has {length} bytes; {HEADER_BYTES} to {MOST_BYTES} are possible")
            if len(self._buffer) < length:
                break
            packets.append(unpack_packet(bytes(self._buffer[:length])))
            del self._buffer[:length]
        return packets


def _packed(text: str) -> tuple[bytes, bytes]:
    data = text.encode("latin-1", "replace")
    return _LENGTH.pack(len(data)), data


def _string(data: bytes, place: int, end: int) -> tuple[str, int]:
    if place + _LENGTH.size > end:
        raise WireError("a message ends within a string's length")
    (length,) = _LENGTH.unpack_from(data, place)
    place += _LENGTH.size
    if not 0 <= length <= end - place:
        raise WireError(f"a string says it has {length} bytes; its message has {end - place} left")
    return data[place : place + length].decode("latin-1"), place + length
