"""Cuts a byte stream into MAVLink packets and finds whom each is for, without decoding it."""

from __future__ import annotations

from collections.abc import Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_V1, _V2 = 0xFE, 0xFD
_V1_FRAMING, _V2_FRAMING, _SIGNATURE = 8, 12, 13
_SIGNED = 1


def _target_offsets() -> dict[int, int]:
    """Byte of ``target_system`` within the payload, by message."""
    offsets = {}
    sizes = {"char": 1, "uint8_t": 1, "int8_t": 1, "uint16_t": 2, "int16_t": 2, "uint32_t": 4, "int32_t": 4}
    sizes |= {"float": 4, "uint64_t": 8, "int64_t": 8, "double": 8}
    for number, kind in mavlink.mavlink_map.items():
        if "target_system" not in kind.ordered_fieldnames:
            continue
        offset = 0
        for name, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
            if name == "target_system":
                break
            offset += sizes[kind.fieldtypes[kind.fieldnames.index(name)]] * max(1, length)
        offsets[number] = offset
    return offsets


TARGET_OFFSETS = _target_offsets()


class FrameCutter:
    """Cuts the bytes of one sender into packets; bytes that are none are skipped."""

    def __init__(self) -> None:
        self._kept = bytearray()

    def cut(self, data: bytes) -> Iterator[bytes]:
        """Whole packets so far; a rest is kept for the next call."""
        kept = self._kept
        kept += data
        start = 0
        while start < len(kept):
            if kept[start] not in (_V1, _V2):
                start += 1
                continue
            size = packet_size(kept, start)
            if size == 0 or start + size > len(kept):
                break
            yield bytes(kept[start : start + size])
            start += size
        del kept[:start]


def packet_size(data: bytes | bytearray, start: int = 0) -> int:
    """Bytes of the packet that begins there; 0 when its header is not complete."""
    if len(data) - start < 3:
        return 0
    if data[start] == _V1:
        return data[start + 1] + _V1_FRAMING
    return data[start + 1] + _V2_FRAMING + (_SIGNATURE if data[start + 2] & _SIGNED else 0)


def target_of(packet: bytes) -> int:
    """System a whole packet is for; 0 for all."""
    if packet[0] == _V1:
        number, header = packet[5], 6
    else:
        number, header = int.from_bytes(packet[7:10], "little"), 10
    offset = TARGET_OFFSETS.get(number)
    if offset is None or offset >= packet[1]:  # trailing zeros of a payload are left out
        return 0
    return packet[header + offset]
