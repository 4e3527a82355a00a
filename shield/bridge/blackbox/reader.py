"""`LogReader`: ticks out of a black-box log, also of one that was cut off by a crash or is damaged in places."""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from zstandard import ZstdError

from ...exceptions import LogError
from ..messages import Closing, Tick
from .format import tick_from_json
from .hash_chain import ChainCheck
from .header import LogHeader
from .recorder import HEADER_TOPIC, LINK_TOPIC, LOG_TOPIC, TICK_TOPIC

LOG = logging.getLogger(__name__)

CHECKSUM_TO_END = 12  # bytes of a file's checksum of its index and of what ends the file after it
DATA_END_BYTES = 13  # of the record that ends the data and holds the checksum of all bytes before it
BLOCK_BYTES = 1 << 20
LARGEST_RECORD = 64 << 20  # longer records than this are damage, bytes
_DAMAGE = (McapError, CRCValidationError, ZstdError, struct.error, UnicodeDecodeError, MemoryError, OverflowError)
_PART = re.compile(r"(?P<first>.+)\.part[1-9]\d*(?P<ending>\.[^.]*)")
PARTS = "is in parts, as 0.8.0 wrote runs of more than 20 minutes; replay it with steerclear 0.8.0"

Tell = Callable[[str], None]


@dataclass(frozen=True)
class LogLine:
    """A line of text: when, ns since 1970; 1 debug, 2 info, 3 warning or 4 error; whom it is about; its words."""

    time_ns: int
    level: int
    name: str
    text: str


class LogReader(Closing):
    """Reads a log once, from its beginning. A context manager.

    Args:
        path: of the log, ``.mcap``.
        key: 32 bytes, to check the codes of a log whose chain carries them; None: they are not looked at.

    Raises:
        LogError: no such file, no log, of another version, or cut off before its header.

    Attributes:
        header: what the shield was built with.
        complete: whether the log was closed; known once `entries` is used up.
        damage: what could not be read, in words; likewise.
        chain: what the log's chain says; likewise.
    """

    def __init__(self, path: Path, key: bytes | None = None) -> None:
        self.path, self.complete = path, False
        self.damage: list[str] = []
        self.chain = ChainCheck(key)
        try:
            if path.exists() and not (path.is_file() or path.is_dir()):  # a pipe would be waited for
                raise OSError(errno.EINVAL, "it is no plain file")
            self._file: IO[bytes] = path.open("rb")
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise LogError(f"cannot open {path} ({why}); give a log that deploy wrote (.mcap)") from None
        try:
            if _PART.fullmatch(path.name) or path.with_name(f"{path.stem}.part2{path.suffix}").exists():
                raise LogError(f"{path} {PARTS}")
            self._messages = self._read()
            self.header = self._find_header()
        except BaseException:
            self._file.close()
            raise

    def entries(self) -> Iterator[Tick | LogLine]:
        """Ticks and lines of text, in order.

        Raises:
            LogError: a tick does not fit this version.
        """
        for topic, message in self._messages:
            if topic == TICK_TOPIC:
                yield tick_from_json(_object(message), self.header.platforms)
            elif topic == LOG_TOPIC:
                row = _object(message)
                try:
                    line = LogLine(message.log_time, int(row["level"]), str(row["name"]), str(row["message"]))
                except (KeyError, TypeError, ValueError, OverflowError):
                    text = "the log holds a line that is none; it is damaged or of another version"
                    raise LogError(text) from None
                yield line

    def ticks(self) -> Iterator[Tick]:
        """Ticks, in order.

        Raises:
            LogError: a tick does not fit this version.
        """
        return (entry for entry in self.entries() if isinstance(entry, Tick))

    def close(self) -> None:
        """Give the file back."""
        self._file.close()

    def _find_header(self) -> LogHeader:
        for topic, message in self._messages:
            if topic == HEADER_TOPIC:
                return LogHeader.from_message(_object(message))
        why = f" ({self.damage[0]})" if self.damage else ""
        raise LogError(f"{self.path} holds no header of a steerclear log{why}; give a log that deploy wrote (.mcap)")

    def _read(self) -> Iterator[tuple[str, Message]]:
        """Records with their topics, added to the chain, whose links are checked; to where the log can be read."""
        topics: dict[int, str] = {}
        has_begun = False
        for item in read_records(self._file, self._tell):
            self.complete = isinstance(item, Footer)
            if isinstance(item, Channel):
                topics[item.id] = item.topic
            if not isinstance(item, Message):
                continue
            topic = topics.get(item.channel_id, "")
            if topic == HEADER_TOPIC and not has_begun:
                has_begun = True
                self.chain.begin(LogHeader.from_message(_object(item)).chain)
            if topic == LINK_TOPIC:
                try:
                    self.chain.link(_object(item))
                except LogError:
                    self.chain.link({})
            else:
                self.chain.add(topic, (item.log_time, item.publish_time, item.sequence), item.data)
                yield topic, item
        self.chain.close(self.complete)

    def _tell(self, text: str) -> None:
        LOG.info("%s: %s", self.path, text)
        self.damage.append(text)


def _object(message: Message) -> Mapping[str, Any]:
    try:
        found = json.loads(message.data)
    except (ValueError, RecursionError) as error:
        raise LogError(f"the log holds a message that is not JSON ({error}); it is damaged") from None
    if not isinstance(found, dict):
        raise LogError("the log holds a message that is not an object; it is damaged or of another version")
    return found


def _unlike_checksums(file: IO[bytes], data_end: DataEnd | None, footer: Footer) -> str:
    """Which bytes of a file that was closed are not those that were written, by its two checksums; empty if all are.

    The first covers everything before the record that ends the data: also what stands between chunks, which no
    checksum of a chunk and no link covers. Logs of 0.9.0 and before have none: it is 0. The second covers the rest.
    """
    end = file.seek(0, os.SEEK_END) - CHECKSUM_TO_END
    data_bytes = footer.summary_start - DATA_END_BYTES
    if not 0 < data_bytes <= end or _checksum(file, footer.summary_start, end) != footer.summary_crc:
        return "bytes of its index, after the chain's end, are not as they were written"
    if data_end is None or data_end.data_section_crc not in (0, _checksum(file, 0, data_bytes)):
        return "some of its bytes are not as they were written, by the checksum of all"
    return ""


def _checksum(file: IO[bytes], begin: int, end: int) -> int:
    """The CRC-32 of the bytes from ``begin`` to before ``end``."""
    file.seek(begin)
    checksum = 0
    for at in range(begin, end, BLOCK_BYTES):
        checksum = zlib.crc32(file.read(min(BLOCK_BYTES, end - at)), checksum)
    return checksum


def read_records(file: IO[bytes], tell: Tell) -> Iterator[Any]:
    """Schemas, channels, messages and, when the file was closed properly, its footer; chunks taken apart.

    Args:
        file: at its beginning.
        tell: gets a text about each part that cannot be read; nothing is raised for them.
    """
    closed, footer, data_end = False, None, None
    try:
        for item in StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_RECORD).records:
            if isinstance(item, Chunk):
                try:
                    parts: list[Any] = list(breakup_chunk(item, validate_crc=True))
                except _DAMAGE as error:
                    tell(f"{item.uncompressed_size} bytes are damaged and left out ({type(error).__name__})")
                    continue
                yield from parts
            elif isinstance(item, (Schema, Channel, Message, Footer)):
                closed = isinstance(item, Footer)
                footer = item if isinstance(item, Footer) else footer
                yield item
            elif isinstance(item, DataEnd):
                data_end = item
        if file.read(1):
            tell("after its end more bytes follow, which were not read")
        elif footer is not None and (text := _unlike_checksums(file, data_end, footer)):
            tell(text)
    except EndOfFile:
        return  # cut off: the footer that was not there tells
    except _DAMAGE as error:
        if isinstance(error, struct.error) and not closed and not file.read(1):
            return  # cut off within a number: the same
        tell(f"from some point on it makes no sense ({type(error).__name__})")
