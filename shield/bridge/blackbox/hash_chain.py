"""The chain of a log: each link digests the records since the last one, and the last link; and following it on reading.

A record that was altered, removed, added or moved shows, and so does an end that was cut off and closed again. This is
evidence against damage and careless changes, no proof of who wrote the log: whoever can write a whole log can write its
chain. With a key each link carries a code that only who has the key can make.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...compat import Self
from ...exceptions import LogError

ENDS = "log"  # how the closing link says that its file is whole
MOST, MOST_BREAKS = 1 << 62, 20  # no log has so many records; breaks kept in words, further ones are counted
_KEY_USE = b"steerclear black box"
_BYTES = hashlib.sha256().digest_size


@dataclass(frozen=True)
class ChainHead:
    """Where the chain of a file begins; part of its header."""

    head: str  # digest the first link builds on, drawn at random, hexadecimal
    count: int = 0  # records before it: 0
    keyed: bool = False  # whether links carry codes

    @classmethod
    def new(cls) -> Self:
        """The beginning of a new log."""
        return cls(os.urandom(_BYTES).hex())

    @classmethod
    def from_text(cls, text: str) -> Self:
        """The head in a header.

        Raises:
            LogError: it is none.
        """
        try:
            found = cls(**json.loads(text))
            sound = len(bytes.fromhex(found.head)) == _BYTES and type(found.count) is int and 0 <= found.count < MOST
        except (TypeError, ValueError, RecursionError):
            sound = False
        if not sound:
            raise LogError("the log's header holds no head of its chain; it is damaged")
        return found


@dataclass(frozen=True)
class Link:
    """A link of the log's chain: the digest of the records since the last link, and of that."""

    count: int  # records up to here, links left out
    digest: str  # hexadecimal
    end: str = ""  # "" within a file, `ENDS` for the one that closes it
    code: str = ""  # with a key, hexadecimal; else ""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """The link in a message.

        Raises:
            LogError: it is none.
        """
        try:
            found = cls(int(content["count"]), *(str(content[name]) for name in ("digest", "end", "code")))
            bytes.fromhex(found.digest)
            if not 0 <= found.count < MOST:
                raise ValueError("no number of records")
        except (KeyError, TypeError, ValueError, OverflowError):
            raise LogError("a link of the log's chain is damaged") from None
        return found


class Chain:
    """Digests records as they are written or read.

    Args:
        head: where it begins.
        key: 32 bytes; None: links carry no codes.

    Attributes:
        count: records so far.
        loose: records since the last link.
    """

    def __init__(self, head: ChainHead, key: bytes | None = None) -> None:
        self.count, self.loose = head.count, 0
        self._key = None if key is None else hmac.digest(key, _KEY_USE, "sha256")
        self._digests = hashlib.sha256(bytes.fromhex(head.head))

    def add(self, topic: str, times: tuple[int, int, int], data: bytes) -> None:
        """Digest a record: its topic; when it was logged and published, ns, and its number there; its content."""
        name = topic.encode()
        self._digests.update(struct.pack(">QQIIQ", *times, len(name), len(data)) + name)
        self._digests.update(data)
        self.count, self.loose = self.count + 1, self.loose + 1

    def next_link(self, end: str = "") -> Link:
        """What the next link would be; nothing changes."""
        digests = self._digests.copy()
        digests.update(struct.pack(">Q", self.count) + end.encode())
        digest = digests.digest()
        code = "" if self._key is None else hmac.digest(self._key, digest, "sha256").hex()
        return Link(self.count, digest.hex(), end, code)

    def go_on(self, link: Link) -> None:
        """Build on a link from now on."""
        self.count, self.loose = link.count, 0
        self._digests = hashlib.sha256(bytes.fromhex(link.digest))


class ChainCheck:
    """What a log's chain says; fed with its messages in their order.

    Args:
        key: of links that carry codes, 32 bytes; None: codes are not looked at.

    Attributes:
        keyed: whether its links carry codes.
        unkeyed: whether they do not, though a key was given.
        codes_checked: how many codes were found right.
        codes_wrong: how many are not of this key; part of ``broken``.
        breaks: what does not fit, in words, `MOST_BREAKS` at most.
        broken: how many things do not fit.
    """

    def __init__(self, key: bytes | None = None) -> None:
        self.keyed = self.unkeyed = False
        self.codes_checked = self.codes_wrong = self.broken = 0
        self.breaks: list[str] = []
        self._key, self._end, self._early = key, "", 0
        self._chain: Chain | None = None

    @property
    def chained(self) -> bool:
        """Whether there is a chain at all."""
        return self._chain is not None

    @property
    def holds(self) -> bool:
        """Whether there is a chain and nothing contradicts it."""
        return self.chained and self.broken == 0

    @property
    def of_another_key(self) -> bool:
        """Whether no code is of the key, and nothing else is wrong."""
        return self.codes_checked == 0 < self.codes_wrong == self.broken

    def begin(self, head: ChainHead) -> None:
        """The header of the file was met, with this head in it."""
        self.unkeyed = self._key is not None and not head.keyed
        if self.unkeyed:
            self._tell("it carries no codes: made without a key, which cannot be checked with the one given")
        if self._early:
            self._tell(f"{self._early} records stand before the header")
        if head.count:
            self._tell(f"the {head.count} records before its first are missing")
        self.keyed, self._chain = head.keyed, Chain(head, self._key)

    def add(self, topic: str, times: tuple[int, int, int], data: bytes) -> None:
        """A record was met; see `Chain.add`."""
        if self._chain is None:
            self._early += 1
            return
        if self._chain.loose == 0:
            self._look_for_end()
        self._chain.add(topic, times, data)

    def link(self, content: Mapping[str, Any]) -> None:
        """A link was met."""
        if self._chain is None:
            self._early += 1
            return
        try:
            found = Link.of(content)
        except LogError as error:
            self._tell(str(error))
            return
        self._look_for_end()
        self._compare(found, self._chain)
        self._chain.go_on(found)
        self._end = found.end

    def close(self, is_closed: bool) -> None:
        """The file's records are at their end; if it was not completed, its writer was killed, or its end cut off."""
        if self.chained and is_closed and not self._end:
            self._tell("its end was cut off and the file closed again")

    def _look_for_end(self) -> None:
        if self._end:
            self._tell("records follow after the end of the file")

    def _compare(self, found: Link, chain: Chain) -> None:
        ours, missing = chain.next_link(found.end), found.count - chain.count
        if missing:
            what = f"{missing} records are missing" if missing > 0 else f"{-missing} records are too many"
            self._tell(f"{what} before record {found.count}")
        elif found.digest != ours.digest:
            self._tell(f"of records {chain.count - chain.loose + 1} to {chain.count} some are not as they were written")
        elif self._key is not None and self.keyed:
            if hmac.compare_digest(found.code, ours.code):
                self.codes_checked += 1
            else:
                self.codes_wrong += 1
                self._tell(f"the code of the link after record {found.count} is not of this key")

    def _tell(self, text: str) -> None:
        self.broken += 1
        if len(self.breaks) < MOST_BREAKS:
            self.breaks.append(text)
