"""`McapWriter`: the black box, a sink of ticks that keeps every one of them on disk."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ...commands import Commands
from ...decision import Decisions
from ...exceptions import BridgeError
from ...fleet import Fleet
from ..messages import Tick
from . import foxglove as fg
from .chain import GOES_ON, ChainHead, Link
from .disk import Disk, explain
from .header import LOG_VERSION, LogHeader
from .mcap_file import McapFile
from .parts import part_header, part_path
from .spool import Spool

_Line = tuple[int, str, str]


PART_S = 1200.0
"""Length of a part of a log, s: its index is kept in memory until it is complete, 90 kB a minute."""


class _Store:
    """What the spool's thread does with ticks and lines, and with the count of those dropped; part after part.

    Args:
        begin: makes the file of a part, by its number from 1 on and the last link of the part before.
        part_s: length of a part, s of the ticks.
    """

    def __init__(self, begin: Callable[[int, Link | None], McapFile], part_s: float) -> None:
        self._begin, self._part_s = begin, part_s
        self._file, self._number = begin(1, None), 1
        self._began_s: float | None = None
        self._told = 0
        self.dropped: Callable[[], int] = lambda: 0

    def keep(self, item: Tick | _Line) -> None:
        if isinstance(item, Tick):
            self._turn_over(item.began_s)
            self._file.add_tick(item)
        else:
            self._file.add_line(*item)

    def flush(self) -> None:
        self._tell_dropped()
        self._file.flush()

    def finish(self) -> None:
        self._tell_dropped()
        self._file.finish()

    def abandon(self) -> None:
        self._file.abandon()

    def _turn_over(self, now_s: float) -> None:
        """Begin the next part when it is time."""
        if self._began_s is None:
            self._began_s = now_s
        if now_s - self._began_s < self._part_s:
            return
        self._tell_dropped()
        try:
            later = self._begin(self._number + 1, self._file.last_link(GOES_ON))
        except BaseException:
            self._file.finish()  # the log ends here
            raise
        self._file.finish(GOES_ON)
        self._number += 1
        self._file, self._began_s = later, now_s

    def _tell_dropped(self) -> None:
        dropped = self.dropped()
        if dropped > self._told:
            text = f"the disk is too slow: {dropped - self._told} ticks before this are missing, {dropped} in all"
            self._file.add_line(fg.ERROR, "black box", text)
            self._told = dropped


class McapWriter:
    """Keeps ticks in MCAP files, at most ``flush_s`` and the disk's own delay behind.

    A long log is a series of files, see `parts`: each can be read by itself, and `LogReader` reads on to the next.

    The header is on the disk when this returns. A log proves the shield's decisions from the first tick that was
    decided by a fresh shield or after `Shield.reset` (``Tick.shield_reset``), so begin it with the first decision.

    Args:
        path: of the new file, ``.mcap``.
        header: what the shield was built with.
        flush_s: longest time between flushes to the disk, s.
        capacity: ticks that may wait for the disk; more are dropped and counted.
        give_up_s: when the disk has taken nothing for so long, s, `take` raises.
        part_s: length of each file, s.
        open_disk: makes a file.
        key: 32 bytes of those who may write this log: its chain then carries codes; None: without.

    Raises:
        BridgeError: the file cannot be made, or not even the header fits on the disk.
    """

    def __init__(
        self,
        path: Path,
        header: LogHeader,
        *,
        flush_s: float = 0.5,
        capacity: int = 300,
        give_up_s: float = 10.0,
        part_s: float = PART_S,
        open_disk: Callable[[Path], Disk] = Disk,
        key: bytes | None = None,
    ) -> None:
        head = header.chain or ChainHead.new()
        self.path, self._key = path, key
        self.header = replace(header, version=LOG_VERSION, chain=replace(head, count=0, keyed=key is not None))
        self._open_disk = open_disk
        store = _Store(self._begin, part_s)
        self._spool: Spool[Tick | _Line] = Spool(
            path.name, store, capacity=capacity, flush_s=flush_s, give_up_s=give_up_s
        )
        store.dropped = lambda: self._spool.dropped

    def _begin(self, number: int, last: Link | None) -> McapFile:
        path = part_path(self.path, number)
        chain = self.header.chain if last is None else ChainHead(last.digest, last.count, self._key is not None)
        disk = self._open_disk(path)
        try:
            return McapFile(disk, part_header(self.header, number, chain), self._key)
        except OSError as error:
            disk.close()
            raise BridgeError(f"cannot begin the log {path}: {explain(error)}") from error

    def take(self, tick: Tick) -> None:
        """Keep a tick; never waits. Its arrays may be changed afterwards, its mappings may not.

        Raises:
            BridgeError: ticks can no longer be kept; the text says why and what to do.
        """
        self._spool.put(_snapshot(tick))

    def note(self, text: str, *, name: str = "steerclear", warning: bool = False) -> None:
        """Keep a line of text at the time of the last tick.

        Raises:
            BridgeError: as `take`.
        """
        self._spool.put((fg.WARNING if warning else fg.INFO, name, text))

    def close(self) -> None:
        """Write what waits and the index; what went wrong is in ``fault``."""
        self._spool.close()

    @property
    def fault(self) -> str:
        """Why nothing is written any more; empty while all is well."""
        return self._spool.fault

    @property
    def dropped(self) -> int:
        """Ticks that were dropped because the disk was too slow."""
        return self._spool.dropped

    @property
    def behind_s(self) -> float:
        """How far the disk is behind, s."""
        return self._spool.behind_s

    @property
    def waiting(self) -> int:
        """Ticks not yet written."""
        return self._spool.waiting


def log_path(folder: Path, ending: str, unix_s: float | None = None, name: str = "steerclear") -> Path:
    """A path for a new log, named after the time, UTC, and this process, so that two that start together do not clash.

    Args:
        folder: the log folder.
        ending: such as ".mcap" or ".tlog".
        unix_s: time, s since 1970; None: now.
        name: first part of the name.
    """
    moment = time.gmtime(time.time() if unix_s is None else unix_s)
    return folder / f"{name}_{time.strftime('%Y%m%dT%H%M%SZ', moment)}_{os.getpid()}{ending}"


def _snapshot(tick: Tick) -> Tick:
    """The tick with its own copies of arrays that the loop may use again."""
    if tick.fleet is None:
        return tick
    fleet = replace(
        tick.fleet,
        state=tick.fleet.state.copy(),
        age_s=None if tick.fleet.age_s is None else tick.fleet.age_s.copy(),
        position_error_m=None if tick.fleet.position_error_m is None else tick.fleet.position_error_m.copy(),
    )
    wanted = None if tick.wanted is None else replace(tick.wanted, values=tick.wanted.values.copy())
    return replace(tick, fleet=fleet, wanted=wanted, decisions=_copied(tick, fleet, wanted))


def _copied(tick: Tick, fleet: Fleet, wanted: Commands | None) -> Decisions | None:
    decisions = tick.decisions
    if decisions is None or wanted is None:
        return None
    same = decisions.sent is tick.wanted
    return replace(
        decisions,
        fleet=fleet,
        wanted=wanted,
        sent=wanted if same else replace(decisions.sent, values=decisions.sent.values.copy()),
        intervened=decisions.intervened.copy(),
        reason=decisions.reason.copy(),
        certificate_m=decisions.certificate_m.copy(),
        slack_m=decisions.slack_m.copy(),
        cut_short=None if decisions.cut_short is None else decisions.cut_short.copy(),
        bound=decisions.bound.copy(),
    )
