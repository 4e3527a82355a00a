"""`McapWriter`: the black box, a sink of ticks that keeps every one of them on disk, in one MCAP file."""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from ...exceptions import BridgeError
from ..messages import Action, Tick
from . import foxglove as fg
from .disk import AsyncWriter, Disk, Store, explain
from .format import TICK, Schema, schema_of, tick_to_json
from .hash_chain import ENDS, Chain, Link
from .header import HEADER, LogHeader
from .nonfinite import plain

LOG = logging.getLogger(__name__)

TICK_TOPIC, HEADER_TOPIC, LOG_TOPIC, LINK_TOPIC = "/tick", "/header", "/log", "/link"
SCENE_TOPIC, FIELD_TOPIC, FIX_TOPIC = "/scene", "/field", "/fix/"
EVERY_S = {SCENE_TOPIC: 0.2, FIX_TOPIC: 1.0, FIELD_TOPIC: 10.0}
LINK = schema_of(Link, "steerclear.Link")
CHUNK_BYTES = 1 << 20  # a chunk is closed at every flush; this only bounds one

Line = tuple[int, str, str]  # a line of the log: its level, who it is about, its text


class McapFile(Store[Tick | Line]):
    """Writes a log; used by one thread.

    Args:
        disk: the file.
        header: first message; on the disk when this returns.
        key: of the codes in the chain's links; None: without.

    Raises:
        OSError: the disk does not take it.
    """

    def __init__(self, disk: Disk, header: LogHeader, key: bytes | None = None) -> None:
        super().__init__(disk)
        self._header = header
        self._chain = Chain(header.chain, key)
        self._writer = Writer(
            disk,  # type: ignore[arg-type]
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,  # of all bytes, those between chunks included
        )
        self._writer.start(profile="", library="steerclear")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._last_ns = header.unix_ns
        self._due_s = dict.fromkeys(EVERY_S, -1e18)
        self._undrawn, self._dropped, self.kept = False, 0, 0
        self.dropped: Callable[[], int] = lambda: 0
        self._active: dict[tuple[str, str, str], Action] = {}
        self._add(HEADER_TOPIC, HEADER, header.to_message(), header.unix_ns)
        self.flush()

    def keep(self, item: Tick | Line) -> None:
        """Write a tick, and what shows it in a viewer, or a line of the log."""
        if not isinstance(item, Tick):
            self._add_line(*item)
            return
        time_ns = self._header.time_ns(item.began_s)
        self._add(TICK_TOPIC, TICK, tick_to_json(item, self._header.platforms), time_ns)
        self._add_lines(item, time_ns)
        try:
            self._draw(item, time_ns)
        except Exception as error:  # a picture is no reason to lose the record
            if not self._undrawn:  # said once, since it may happen at every tick
                LOG.warning("drawing in the log failed", exc_info=error)
                text = f"drawing failed ({type(error).__name__}: {error}); the ticks are whole"
                self._add_line(fg.WARNING, "black box", text)
            self._undrawn = True
        self._link()

    def flush(self) -> None:
        """Bring everything to the disk, up to a link."""
        self._tell_dropped()
        if self._chain.loose:
            self._link()
        self._writer.flush()
        super().flush()
        self.kept = self._counts.get(TICK_TOPIC, 0)

    def finish(self) -> None:
        """Write the closing link and the index, close the file."""
        self._tell_dropped()
        self._link(ENDS)
        self._writer.finish()
        super().finish()
        self.kept = self._counts.get(TICK_TOPIC, 0)

    def _tell_dropped(self) -> None:
        dropped, before = self.dropped(), self._dropped
        if dropped > before:
            text = f"the disk is too slow: {dropped - before} ticks before this are missing, {dropped} in all"
            self._add_line(fg.ERROR, "black box", text)
            self._dropped = dropped

    def _add_lines(self, tick: Tick, time_ns: int) -> None:
        """Actions that begin and end, what autopilots said, what links refused."""
        now = {(action.subject, action.condition, action.response): action for action in tick.actions}
        begun = [action for key, action in now.items() if key not in self._active]
        over = [action for key, action in self._active.items() if key not in now]
        self._active = now
        lines = [(fg.WARNING, action.subject, f"{action.condition}: {action.text}") for action in begun]
        lines += [(fg.INFO, action.subject, f"{action.condition}: {action.response} is over") for action in over]
        for reading in tick.readings.values():
            lines += [(fg.INFO, reading.boat, text) for text in reading.texts]
            lines += [(fg.WARNING, reading.boat, f"refused: {kind} ({n})") for kind, n in reading.faults.items()]
        for line in lines:
            self._add_line(*line, time_ns)

    def _draw(self, tick: Tick, time_ns: int) -> None:
        if self._is_due(SCENE_TOPIC, tick.began_s):
            scene = fg.scene_of(tick, time_ns, self._header.config.separation_m)
            if scene is not None:
                self._add(SCENE_TOPIC, fg.SCENE_UPDATE, scene, time_ns)
        if self._is_due(FIELD_TOPIC, tick.began_s):
            self._add(FIELD_TOPIC, fg.SCENE_UPDATE, fg.field_of(self._header, tick.surroundings, time_ns), time_ns)
        if self._is_due(FIX_TOPIC, tick.began_s):
            for name, fix in fg.fixes_of(tick, self._header, time_ns).items():
                self._add(FIX_TOPIC + name, fg.LOCATION_FIX, fix, time_ns)

    def _is_due(self, topic: str, now_s: float) -> bool:
        """Whether it is time for a topic again; times are kept in step so that ticks a little early count."""
        due = now_s >= self._due_s[topic] - 0.01
        if due:
            self._due_s[topic] = now_s + EVERY_S[topic]
        return due

    def _add_line(self, level: int, name: str, text: str, time_ns: int | None = None) -> None:
        """At the time of the last message when none is given."""
        at_ns = self._last_ns if time_ns is None else time_ns
        self._add(LOG_TOPIC, fg.LOG, fg.log_message(at_ns, level, name, text), at_ns)

    def _link(self, end: str = "") -> None:
        link = self._chain.next_link(end)
        self._add(LINK_TOPIC, LINK, vars(link), self._last_ns)
        self._chain.go_on(link)

    def _add(self, topic: str, schema: Schema, message: dict[str, Any], time_ns: int) -> None:
        if topic not in self._channels:
            title = schema["title"]
            if title not in self._schemas:
                text = json.dumps(schema, separators=(",", ":")).encode()
                self._schemas[title] = self._writer.register_schema(title, "jsonschema", text)
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[title])
        self._last_ns = max(self._last_ns, time_ns)  # a log is read in order of time
        data = json.dumps(message, allow_nan=False, separators=(",", ":"), default=plain).encode()
        number = self._counts[topic] = self._counts.get(topic, 0) + 1
        if topic != LINK_TOPIC:
            self._chain.add(topic, (self._last_ns, self._last_ns, number), data)
        self._writer.add_message(self._channels[topic], self._last_ns, data, self._last_ns, number)


class McapWriter(AsyncWriter[Tick | Line]):
    """Keeps ticks in an MCAP file, at most ``flush_s`` and the disk's own delay behind.

    The header is on the disk when this returns. A log proves the shield's decisions from the first tick that was
    decided by a fresh shield or after `Shield.reset` (``Tick.shield_reset``), so begin it with the first decision.

    Args:
        path: of the new file, ``.mcap``.
        header: what the shield was built with.
        flush_s, capacity, give_up_s: see `AsyncWriter`.
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
        open_disk: Callable[[Path], Disk] = Disk,
        key: bytes | None = None,
    ) -> None:
        self.path = path
        self.header = replace(header, chain=replace(header.chain, count=0, keyed=key is not None))
        disk = open_disk(path)
        try:
            file = McapFile(disk, self.header, key)
        except OSError as error:
            disk.close()
            raise BridgeError(f"cannot begin the log {path}: {explain(error)}") from error
        file.dropped = lambda: self.dropped
        self._file, self._taken = file, 0
        super().__init__(path.name, file, capacity=capacity, flush_s=flush_s, give_up_s=give_up_s)

    def take(self, tick: Tick) -> None:
        """Keep a tick; never waits. Its arrays may be changed afterwards, its mappings may not.

        Raises:
            BridgeError: ticks can no longer be kept; the text says why and what to do.
        """
        self._taken += 1
        self.put(_snapshot(tick))

    @property
    def missing(self) -> str:
        """What the log lacks of the turns it was handed, in words; empty when, once closed, it has all of them."""
        kept, taken = self._file.kept, self._taken
        return "" if kept == taken and not self.fault else f"the log is incomplete: {kept} of {taken} turns"

    def note(self, text: str, *, name: str = "steerclear", warning: bool = False) -> None:
        """Keep a line of text at the time of the last tick.

        Raises:
            BridgeError: as `take`.
        """
        self.put((fg.WARNING if warning else fg.INFO, name, text))


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
    fleet, nominal, decisions = _copied(tick.fleet), tick.nominal, tick.decisions
    nominal = None if nominal is None else _copied(nominal)
    if decisions is not None and nominal is not None:
        sent = nominal if decisions.filtered is tick.nominal else _copied(decisions.filtered)
        decisions = replace(_copied(decisions), fleet=fleet, nominal=nominal, filtered=sent)
    return replace(tick, fleet=fleet, nominal=nominal, decisions=None if nominal is None else decisions)


def _copied(entry: Any) -> Any:
    """A frozen dataclass with copies of its arrays."""
    return replace(entry, **{n: value.copy() for n, value in vars(entry).items() if isinstance(value, np.ndarray)})
