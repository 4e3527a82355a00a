"""The chain of a log: each link digests the records since the last one, and the last link.

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

GOES_ON, ENDS = "part", "log"
"""How a closing link ends its file: another part follows, or none."""
MOST = 1 << 62
"""No log has so many records."""
_KEY_USE = b"steerclear black box"
_DIGITS = 2 * hashlib.sha256().digest_size


@dataclass(frozen=True)
class ChainHead:
    """Where the chain of a file begins; part of its header.

    Attributes:
        head: digest the first link builds on, hexadecimal: of the last link of the part before, or drawn at random.
        count: records in the parts before.
        keyed: whether links carry codes.
    """

    head: str
    count: int = 0
    keyed: bool = False

    @classmethod
    def new(cls) -> Self:
        """The beginning of a new log."""
        return cls(os.urandom(_DIGITS // 2).hex())

    @classmethod
    def from_text(cls, text: str) -> Self:
        """The head in a header.

        Raises:
            LogError: it is none.
        """
        try:
            found = cls(**json.loads(text))
            sound = len(bytes.fromhex(found.head)) == _DIGITS // 2 and 0 <= int(found.count) < MOST
        except (TypeError, ValueError, RecursionError):
            sound = False
        if not sound:
            raise LogError("the log's header holds no head of its chain; it is damaged")
        return found


@dataclass(frozen=True)
class Link:
    """One link.

    Attributes:
        count: records up to here, links left out, parts before included.
        digest: hexadecimal.
        end: "" within a file, `GOES_ON` or `ENDS` for the one that closes it.
        code: with a key, hexadecimal; else "".
    """

    count: int
    digest: str
    end: str = ""
    code: str = ""

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
    """

    def __init__(self, head: ChainHead, key: bytes | None = None) -> None:
        self.count = head.count
        self.loose = 0
        """Records since the last link."""
        self._key = None if key is None else hmac.digest(key, _KEY_USE, "sha256")
        self._digests = hashlib.sha256(bytes.fromhex(head.head))

    def add(self, topic: str, times: tuple[int, int, int], data: bytes) -> None:
        """Digest a record.

        Args:
            topic: its topic.
            times: when it was logged and published, ns, and its number within its topic.
            data: its content.
        """
        name = topic.encode()
        self._digests.update(struct.pack(">QQIIQ", *times, len(name), len(data)) + name)
        self._digests.update(data)
        self.count += 1
        self.loose += 1

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
