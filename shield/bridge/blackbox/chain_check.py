"""Following the chain of a log while it is read: what does not fit is told, in words."""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from typing import Any

from ...exceptions import LogError
from .chain import ENDS, GOES_ON, Chain, ChainHead, Link

MOST_BREAKS = 20
"""Breaks kept in words; further ones are counted."""


class ChainCheck:
    """What a log's chain says; fed with its messages in their order, file after file.

    Args:
        key: of links that carry codes, 32 bytes; None: codes are not looked at.

    Attributes:
        chained: whether there is a chain at all; logs of version 1 have none.
        keyed: whether its links carry codes.
        codes_checked: how many codes were found right.
        breaks: what does not fit, in words, `MOST_BREAKS` at most.
        broken: how many things do not fit.
        is_mended: the file says that `records.mend` wrote it from one that was cut off.
        end: what the last link said of the end of its file; "" while it did not.
    """

    def __init__(self, key: bytes | None = None) -> None:
        self.chained = self.keyed = self.is_mended = False
        self.codes_checked = self.broken = 0
        self.breaks: list[str] = []
        self.end = ""
        self._key = key
        self._chain: Chain | None = None
        self._last = ""
        self._early = 0
        self._is_bare = self._is_denied = False

    @property
    def holds(self) -> bool:
        """Whether there is a chain and nothing contradicts it."""
        return self.chained and self.broken == 0

    def begin(self, head: ChainHead | None, is_first: bool = False) -> None:
        """The header of a file was met.

        Args:
            head: in it; None: that log has no chain.
            is_first: whether it is the log's first file.
        """
        if self._key is not None and (head is None or not head.keyed):
            self._tell("it carries no codes, though a key was given: it was written without the key")
        if head is None:
            self._is_bare = True
            return
        if self._early:
            self._tell(f"{self._early} records stand before the header")
        if self._chain is not None:
            self._join(self._chain, head)
        elif head.count and is_first:
            self._tell(f"the {head.count} records before its first are missing")
        self.chained, self.keyed = True, head.keyed
        self._chain, self._last, self.end, self._early = Chain(head, self._key), head.head, "", 0

    def add(self, topic: str, times: tuple[int, int, int], data: bytes) -> None:
        """A record was met; see `Chain.add`."""
        if self._chain is None:
            self._early += 1
            return
        if (self.end or self.is_mended) and self._chain.loose == 0:
            self._tell("records follow after the end of the file")
        self._chain.add(topic, times, data)

    def link(self, content: Mapping[str, Any]) -> None:
        """A link was met."""
        chain = self._chain
        if chain is None:
            if self._is_bare:
                self.deny()
            self._early += 1
            return
        try:
            found = Link.of(content)
        except LogError as error:
            self._tell(str(error))
            return
        if self.end or self.is_mended:
            self._tell("records follow after the end of the file")
        self._compare(chain, found)
        chain.go_on(found)
        self._last, self.end = found.digest, found.end

    def _compare(self, chain: Chain, found: Link) -> None:
        ours = chain.next_link(found.end)
        missing = found.count - chain.count
        if missing:
            what = f"{missing} records are missing" if missing > 0 else f"{-missing} records are too many"
            self._tell(f"{what} before record {found.count}")
        elif found.digest != ours.digest:
            self._tell(f"of records {chain.count - chain.loose + 1} to {chain.count} some are not as they were written")
        elif self._key is not None and self.keyed:
            if hmac.compare_digest(found.code, ours.code):
                self.codes_checked += 1
            else:
                self._tell(f"the code of the link after record {found.count} is not of this key")

    def deny(self) -> None:
        """The log says that it has no chain, and was written by a program that writes one."""
        if not self._is_denied:
            self._tell("its chain was taken out")
        self._is_denied = True

    def mend(self) -> None:
        """The mark of a mended file was met."""
        self.is_mended = True

    def close(self, is_closed: bool) -> None:
        """A file's records are at their end.

        Args:
            is_closed: whether the file was completed; if not, its writer was killed, or its end was cut off.
        """
        if self._chain is not None and is_closed and not self.end and not self.is_mended:
            self._tell("its end was cut off and the file closed again")

    def finish(self) -> None:
        """No file follows."""
        if self.end == GOES_ON:
            self._tell("the next part is missing")

    def _join(self, before: Chain, head: ChainHead) -> None:
        """See that a file goes on where the one before ended; the writer may have been killed in between."""
        last = self._last if self.end else before.next_link(GOES_ON).digest
        if self.end == ENDS:
            self._tell("a part follows after the log's end")
        elif (last, before.count) != (head.head, head.count):
            self._tell(f"a part begins with record {head.count + 1}, not where the one before ended, at {before.count}")

    def _tell(self, text: str) -> None:
        self.broken += 1
        if len(self.breaks) < MOST_BREAKS:
            self.breaks.append(text)
