"""Records of an MCAP file as far as they can be read, whole or cut off, sound or damaged."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Chunk, Footer, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import Writer
from zstandard import ZstdError

from ...exceptions import LogError
from .disk import Disk
from .schemas import MENDED

MENDED_TOPIC = "/mended"
LARGEST_RECORD = 64 << 20
"""Longer records than this are damage, bytes."""

_DAMAGE = (McapError, CRCValidationError, ZstdError, struct.error, UnicodeDecodeError, MemoryError, OverflowError)

Tell = Callable[[str], None]


def read_records(file: IO[bytes], tell: Tell) -> Iterator[Any]:
    """Schemas, channels, messages and, when the file was closed properly, its footer; chunks taken apart.

    Args:
        file: at its beginning.
        tell: gets a text about each part that cannot be read; nothing is raised for them.
    """
    try:
        for item in StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_RECORD).records:
            if isinstance(item, Chunk):
                yield from _parts(item, tell)
            elif isinstance(item, (Schema, Channel, Message, Footer)):
                yield item
        if file.read(1):
            tell("after its end more bytes follow, which were not read")
    except EndOfFile:
        return  # cut off: the footer that was not there tells
    except _DAMAGE as error:
        tell(f"from some point on it makes no sense ({type(error).__name__})")


def _parts(chunk: Chunk, tell: Tell) -> list[Any]:
    try:
        return list(breakup_chunk(chunk, validate_crc=True))
    except _DAMAGE as error:
        tell(f"{chunk.uncompressed_size} bytes are damaged and left out ({type(error).__name__})")
        return []


def mend(source: Path, target: Path) -> tuple[int, list[str]]:
    """Write what can be read of a log as a whole file with an index, which viewers open that refuse a cut-off one.

    Args:
        source: the log.
        target: new file.

    Returns:
        Messages written, and what could not be read.

    Raises:
        LogError: the log cannot be opened or holds nothing, or the file cannot be written.
        BridgeError: the file cannot be made.
    """
    damage: list[str] = []
    try:
        with source.open("rb") as file:
            return _copy(read_records(file, damage.append), target, damage), damage
    except OSError as error:
        raise LogError(f"cannot mend {source} ({error.strerror}); check both paths and the room on the disk") from None


def _copy(records: Iterator[Any], target: Path, damage: list[str]) -> int:
    disk = Disk(target)
    writer = Writer(disk)  # type: ignore[arg-type]
    writer.start(library="steerclear")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count, last_ns, is_whole = 0, 0, False
    for item in records:
        if isinstance(item, Schema) and item.id not in schemas:
            schemas[item.id] = writer.register_schema(item.name, item.encoding, item.data)
        elif isinstance(item, Channel) and item.id not in channels and item.schema_id in schemas:
            channels[item.id] = writer.register_channel(item.topic, item.message_encoding, schemas[item.schema_id])
        elif isinstance(item, Message) and item.channel_id in channels:
            count, last_ns = count + 1, item.log_time
            writer.add_message(channels[item.channel_id], item.log_time, item.data, item.publish_time, item.sequence)
            disk.flush()
        is_whole = isinstance(item, Footer)
    if not is_whole:
        count += 1
        _mark(writer, last_ns, damage)
    writer.finish()
    disk.flush()
    disk.close()
    return count


def _mark(writer: Writer, time_ns: int, damage: list[str]) -> None:
    """Say in the file that it was cut off: it is closed, and yet not whole."""
    schema = writer.register_schema(MENDED["title"], "jsonschema", json.dumps(MENDED).encode())
    channel = writer.register_channel(MENDED_TOPIC, "json", schema)
    writer.add_message(channel, time_ns, json.dumps({"damage": damage}).encode(), time_ns, 1)
