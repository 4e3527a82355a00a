"""`TlogWriter`: every MAVLink packet with its time, as `mavlogdump.py` and ground stations read it."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from pathlib import Path

from ...exceptions import BridgeError
from .disk import Disk
from .spool import Spool

LOG = logging.getLogger(__name__)

Entry = tuple[str, bytes, int]

_HEAD = {0xFE: 6, 0xFD: 10}
"""Length of the head by start byte: MAVLink 1 and 2."""
_CHECKSUM = 2
_SIGNATURE = 13
_SIGNED = 0x01


def split_packets(data: bytes) -> tuple[list[bytes], bytes, int]:
    """Cut a run of bytes into MAVLink packets by their lengths; checksums are not looked at.

    Args:
        data: bytes in the order they came.

    Returns:
        The packets, the beginning of one not yet complete, and how many bytes belong to none.
    """
    packets: list[bytes] = []
    at = lost = 0
    while at < len(data):
        head = _HEAD.get(data[at])
        if head is None:
            at, lost = at + 1, lost + 1
            continue
        if len(data) - at < head:
            break
        size = head + data[at + 1] + _CHECKSUM
        if data[at] == 0xFD and data[at + 2] & _SIGNED:
            size += _SIGNATURE
        if len(data) - at < size:
            break
        packets.append(data[at : at + size])
        at += size
    return packets, data[at:], lost


class _TlogFile:
    """The file; used by the spool's thread only."""

    def __init__(self, disk: Disk) -> None:
        self._disk, self._rest = disk, {"in": b"", "out": b""}
        self.lost = 0

    def keep(self, item: Entry) -> None:
        direction, raw, unix_us = item
        packets, rest, lost = split_packets(self._rest.get(direction, b"") + raw)
        self._rest[direction] = rest
        self.lost += lost
        link = 1 if direction == "out" else 0  # the two lowest bits of the time tell links apart
        stamp = struct.pack(">Q", (max(0, unix_us) & ~3) | link)
        for packet in packets:
            self._disk.write(stamp + packet)

    def flush(self) -> None:
        self._disk.flush()
        self._disk.sync()

    def finish(self) -> None:
        self.flush()
        self._disk.close()

    def abandon(self) -> None:
        self._disk.close()


class TlogWriter:
    """Writes packets of one endpoint; hand `on_bytes` to it.

    Args:
        path: of the new file, ``.tlog``.
        flush_s: longest time between flushes, s.
        capacity: runs of bytes that may wait for the disk; more are dropped and counted.
        open_disk: makes the file.

    Raises:
        BridgeError: the file cannot be made.
    """

    def __init__(
        self, path: Path, *, flush_s: float = 0.5, capacity: int = 20_000, open_disk: Callable[[Path], Disk] = Disk
    ) -> None:
        self.path = path
        self._file = _TlogFile(open_disk(path))
        self._spool: Spool[Entry] = Spool(path.name, self._file, capacity=capacity, flush_s=flush_s)

    def on_bytes(self, direction: str, raw: bytes, unix_us: int) -> None:
        """Take bytes as they came or went; never waits, never raises.

        Args:
            direction: "in" or "out".
            raw: one or several packets, or pieces of them.
            unix_us: time, microseconds since 1970.
        """
        try:
            self._spool.put((direction, bytes(raw), unix_us))
        except BridgeError:
            return  # said once in the log by the spool; the black box is the one that makes the loop fall back

    @property
    def fault(self) -> str:
        """Why nothing is written any more; empty while all is well."""
        return self._spool.fault

    @property
    def dropped(self) -> int:
        """Runs of bytes dropped because the disk was too slow."""
        return self._spool.dropped

    @property
    def lost(self) -> int:
        """Bytes that belong to no packet, which are not written."""
        return self._file.lost

    def close(self) -> None:
        """Complete the file."""
        self._spool.close()
