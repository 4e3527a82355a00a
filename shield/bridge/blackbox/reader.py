"""`LogReader`: ticks out of a black-box log, also of one that was cut off by a crash or is damaged in places."""

from __future__ import annotations

import errno
import json
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from mcap.records import Channel, Footer, Message

from ...compat import Self
from ...exceptions import LogError
from ..messages import Tick
from .chain_check import ChainCheck
from .decode import tick_from_json
from .header import LogHeader
from .mcap_file import HEADER_TOPIC, LINK_TOPIC, LOG_TOPIC, TICK_TOPIC
from .origin import source_digest
from .parts import follows, later_parts, number_of
from .records import MENDED_TOPIC, read_records

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class LogLine:
    """A line of text in a log.

    Attributes:
        time_ns: when, ns since 1970.
        level: 1 debug, 2 info, 3 warning, 4 error.
        name: who it is about.
        text: the line.
    """

    time_ns: int
    level: int
    name: str
    text: str


class LogReader:
    """Reads a log once, from its beginning, and on through the later files of a long one. A context manager.

    Args:
        path: of the log, ``.mcap``, or of a later part, to begin there.
        key: 32 bytes, to check the codes of a log whose chain carries them; None: they are not looked at.

    Raises:
        LogError: no such file, no log, of another version, or cut off before its header.

    Attributes:
        header: what the shield was built with.
        files: those read so far.
        complete: whether the log was closed, if only by `mend`; known once `entries` is used up.
        damage: what could not be read, in words; likewise.
        chain: what the log's chain says; likewise.
    """

    def __init__(self, path: Path, key: bytes | None = None) -> None:
        self.path, self.complete = path, False
        self.damage: list[str] = []
        self.chain = ChainCheck(key)
        self.files = [path]
        self._topics: dict[int, str] = {}
        try:
            self._file: IO[bytes] = _open(path)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise LogError(f"cannot open {path} ({why}); give a log that deploy wrote (.mcap)") from None
        try:
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
                content = _object(message)
                if "odd" in content and self.header.chain is None:
                    self.chain.deny()  # only logs with a chain have it
                yield tick_from_json(content, self.header.platforms)
            elif topic == LOG_TOPIC:
                yield _line(message)

    def ticks(self) -> Iterator[Tick]:
        """Ticks, in order.

        Raises:
            LogError: a tick does not fit this version.
        """
        return (entry for entry in self.entries() if isinstance(entry, Tick))

    def close(self) -> None:
        """Give the file back."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _find_header(self) -> LogHeader:
        for topic, message in self._messages:
            if topic == HEADER_TOPIC:
                return LogHeader.from_message(_object(message))
        why = f" ({self.damage[0]})" if self.damage else ""
        raise LogError(f"{self.path} holds no header of a steerclear log{why}; give a log that deploy wrote (.mcap)")

    def _read(self) -> Iterator[tuple[str, Message]]:
        """Messages with their topics, file after file; ends where the log can no longer be read."""
        yield from self._read_file()
        yield from self._read_later()
        self.chain.finish()

    def _read_later(self) -> Iterator[tuple[str, Message]]:
        are_whole = True
        for number, path in later_parts(self.path):
            if not self.complete:
                are_whole = False
                self._tell(f"{self.files[-1].name} was cut off")
            self.complete = False
            try:
                later = _open(path)
            except OSError as error:
                self._tell(f"part {number}, {path.name}, cannot be read ({error.strerror}); what follows is left out")
                return
            self._file.close()
            self._file, self._topics = later, {}
            messages = self._read_file()
            if not any(topic == HEADER_TOPIC and self._belongs(message) for topic, message in messages):
                self._tell(f"{path.name} is of another log, or cut off before its header; it is left out")
                self.complete = False
                return
            self.files.append(path)
            yield from messages
        self.complete &= are_whole

    def _belongs(self, message: Message) -> bool:
        return follows(self.header, LogHeader.from_message(_object(message)))

    def _read_file(self) -> Iterator[tuple[str, Message]]:
        has_begun = False
        for item in read_records(self._file, self._tell):
            self.complete = isinstance(item, Footer)
            if isinstance(item, Channel):
                self._topics[item.id] = item.topic
            elif isinstance(item, Message):
                topic = self._topics.get(item.channel_id, "")
                if topic == HEADER_TOPIC and not has_begun:
                    has_begun = True
                    self._begin_chain(item)
                if self._is_record(topic, item):
                    yield topic, item
        self.chain.close(self.complete)

    def _begin_chain(self, message: Message) -> None:
        """Follow the chain of the file whose header was met."""
        is_first = len(self.files) == 1 and number_of(self.path)[1] == 1
        header = LogHeader.from_message(_object(message))
        self.chain.begin(header.chain, is_first)
        if header.chain is None and header.sources == source_digest():
            self.chain.deny()

    def _is_record(self, topic: str, message: Message) -> bool:
        """Whether a message is one of the log's records; all are added to the chain, links are checked."""
        if topic == LINK_TOPIC:
            try:
                self.chain.link(_object(message))
            except LogError:
                self.chain.link({})
        elif topic == MENDED_TOPIC:
            self.chain.mend()
        else:
            self.chain.add(topic, (message.log_time, message.publish_time, message.sequence), message.data)
            return True
        return False

    def _tell(self, text: str) -> None:
        LOG.info("%s: %s", self.path, text)
        self.damage.append(text)


def _open(path: Path) -> IO[bytes]:
    """The file; a pipe would be waited for, a device read for ever.

    Raises:
        OSError: it cannot be read, or is no plain file.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "it is no plain file")
    return path.open("rb")


def _line(message: Message) -> LogLine:
    row = _object(message)
    try:
        return LogLine(message.log_time, int(row["level"]), str(row["name"]), str(row["message"]))
    except (KeyError, TypeError, ValueError, OverflowError):
        raise LogError("the log holds a line that is none; it is damaged or of another version") from None


def _object(message: Message) -> Mapping[str, Any]:
    try:
        found = json.loads(message.data)
    except (ValueError, RecursionError) as error:
        raise LogError(f"the log holds a message that is not JSON ({error}); it is damaged") from None
    if not isinstance(found, dict):
        raise LogError("the log holds a message that is not an object; it is damaged or of another version")
    return found
