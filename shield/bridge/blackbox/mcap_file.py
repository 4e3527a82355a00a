"""The MCAP file of a black box: topics, their schemas, and what is written of a tick."""

from __future__ import annotations

import json
import logging
from typing import Any

from mcap.writer import CompressionType, Writer

from ..messages import Action, Tick
from . import foxglove as fg
from .chain import ENDS, Chain, ChainHead, Link
from .disk import Disk
from .drawing import field_of, fixes_of, scene_of
from .encode import tick_to_json
from .header import LogHeader
from .numbers import plain
from .schemas import HEADER, LINK, TICK, Schema

LOG = logging.getLogger(__name__)

TICK_TOPIC, HEADER_TOPIC, LOG_TOPIC, LINK_TOPIC = "/tick", "/header", "/log", "/link"
SCENE_TOPIC, FIELD_TOPIC, FIX_TOPIC = "/scene", "/field", "/fix/"
SCENE_EVERY_S, FIX_EVERY_S, FIELD_EVERY_S = 0.2, 1.0, 10.0
CHUNK_BYTES = 1 << 20
"""A chunk is closed at every flush; this only bounds one."""


class McapFile:
    """Writes a log; used by one thread.

    Args:
        disk: the file.
        header: first message; on the disk when this returns.
        key: of the codes in the chain's links; None: without.

    Raises:
        OSError: the disk does not take it.
    """

    def __init__(self, disk: Disk, header: LogHeader, key: bytes | None = None) -> None:
        self._disk, self._header = disk, header
        self._chain = Chain(ChainHead.new() if header.chain is None else header.chain, key)
        self._writer = Writer(disk, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._writer.start(profile="", library="steerclear")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._last_ns = header.unix_ns
        self._due_s = {SCENE_TOPIC: -1e18, FIX_TOPIC: -1e18, FIELD_TOPIC: -1e18}
        self._undrawn = False
        self._active: dict[tuple[str, str, str], Action] = {}
        self._add(HEADER_TOPIC, HEADER, header.to_message(), header.unix_ns)
        self.flush()

    def add_tick(self, tick: Tick) -> None:
        """Write a tick, and what shows it in a viewer."""
        time_ns = self._header.time_ns(tick.began_s)
        self._add(TICK_TOPIC, TICK, tick_to_json(tick, self._header.platforms), time_ns)
        self._add_lines(tick, time_ns)
        try:
            self._draw(tick, time_ns)
        except Exception as error:  # a picture is no reason to lose the record
            self._tell_undrawn(error)
        self._link(self._chain.next_link())

    def add_line(self, level: int, name: str, text: str, time_ns: int | None = None) -> None:
        """Write a line of the log, at the time of the last message when none is given."""
        at_ns = self._last_ns if time_ns is None else time_ns
        self._add(LOG_TOPIC, fg.LOG, fg.log_message(at_ns, level, name, text), at_ns)

    def flush(self) -> None:
        """Bring everything to the disk, up to a link."""
        if self._chain.loose:
            self._link(self._chain.next_link())
        self._writer.flush()
        self._disk.sync()

    def last_link(self, end: str) -> Link:
        """What `finish` closes the file with."""
        return self._chain.next_link(end)

    def finish(self, end: str = ENDS) -> None:
        """Write the closing link and the index, close the file.

        Args:
            end: `chain.GOES_ON` when another part follows.
        """
        self._link(self._chain.next_link(end))
        self._writer.finish()
        self._disk.flush()
        self._disk.sync()
        self._disk.close()

    def abandon(self) -> None:
        """Close the file as it is."""
        self._disk.close()

    def _add_lines(self, tick: Tick, time_ns: int) -> None:
        """Actions that begin and end, what autopilots said, what links refused."""
        now = {(action.subject, action.condition, action.response): action for action in tick.actions}
        for key, action in now.items():
            if key not in self._active:
                self.add_line(fg.WARNING, action.subject, f"{action.condition}: {action.text}", time_ns)
        for key, action in self._active.items():
            if key not in now:
                self.add_line(fg.INFO, action.subject, f"{action.condition}: {action.response} is over", time_ns)
        self._active = now
        for reading in tick.readings.values():
            for text in reading.texts:
                self.add_line(fg.INFO, reading.boat, text, time_ns)
            for kind, count in reading.faults.items():
                self.add_line(fg.WARNING, reading.boat, f"refused: {kind} ({count})", time_ns)

    def _draw(self, tick: Tick, time_ns: int) -> None:
        if self._due(SCENE_TOPIC, tick.began_s, SCENE_EVERY_S):
            scene = scene_of(tick, time_ns, self._header.config.separation_m)
            if scene is not None:
                self._add(SCENE_TOPIC, fg.SCENE_UPDATE, scene, time_ns)
        if self._due(FIELD_TOPIC, tick.began_s, FIELD_EVERY_S):
            self._add(FIELD_TOPIC, fg.SCENE_UPDATE, field_of(self._header, tick.surroundings, time_ns), time_ns)
        if self._due(FIX_TOPIC, tick.began_s, FIX_EVERY_S):
            for name, fix in fixes_of(tick, self._header, time_ns).items():
                self._add(FIX_TOPIC + name, fg.LOCATION_FIX, fix, time_ns)

    def _tell_undrawn(self, error: Exception) -> None:
        """Once, since it may happen at every tick."""
        if not self._undrawn:
            LOG.warning("drawing in the log failed", exc_info=error)
            self.add_line(
                fg.WARNING, "black box", f"drawing failed ({type(error).__name__}: {error}); the ticks are whole"
            )
        self._undrawn = True

    def _due(self, topic: str, now_s: float, every_s: float) -> bool:
        """Whether it is time for a topic again; times are kept in step so that ticks a little early count."""
        due = now_s >= self._due_s[topic] - 0.01
        if due:
            self._due_s[topic] = now_s + every_s
        return due

    def _add(self, topic: str, schema: Schema, message: dict[str, Any], time_ns: int) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._open(topic, schema)
        self._last_ns = max(self._last_ns, time_ns)  # a log is read in order of time
        data = json.dumps(message, allow_nan=False, separators=(",", ":"), default=plain).encode()
        self._counts[topic] += 1
        if topic != LINK_TOPIC:
            self._chain.add(topic, (self._last_ns, self._last_ns, self._counts[topic]), data)
        self._writer.add_message(channel, self._last_ns, data, self._last_ns, self._counts[topic])

    def _link(self, link: Link) -> None:
        self._add(LINK_TOPIC, LINK, vars(link), self._last_ns)
        self._chain.go_on(link)

    def _open(self, topic: str, schema: Schema) -> int:
        title = schema["title"]
        if title not in self._schemas:
            text = json.dumps(schema, separators=(",", ":")).encode()
            self._schemas[title] = self._writer.register_schema(title, "jsonschema", text)
        self._counts[topic] = 0
        self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[title])
        return self._channels[topic]
