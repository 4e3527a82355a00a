"""`StandInDb`: a small MOOSDB on this machine alone, for demonstrations and tests where MOOS is not installed.

It keeps what clients can see of a real one: the handshake, mail to all who registered, periods, wildcards, the type of
a variable fixed by its first write, heartbeats echoed, silent clients dropped.
"""

from __future__ import annotations

import contextlib
import fnmatch
import select
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from .wire import (
    DATA,
    NOTIFY,
    POISON,
    PROTOCOL,
    REGISTER,
    STRING,
    TIMING,
    UNREGISTER,
    WELCOME,
    WILDCARD,
    Message,
    PacketReader,
    WireError,
    notify,
    pack_packet,
)

SILENCE_S = 5.0
MOST_WAITING = 1 << 20
LOOK_S = 0.05


@dataclass
class _Client:
    """One connection."""

    wire: socket.socket
    name: str = ""
    opening: bytes = b""
    reader: PacketReader = field(default_factory=PacketReader)
    waiting: bytearray = field(default_factory=bytearray)
    periods: dict[str, float] = field(default_factory=dict)
    delivered_s: dict[str, float] = field(default_factory=dict)
    patterns: list[tuple[str, str, float]] = field(default_factory=list)
    heard_s: float = field(default_factory=time.monotonic)


class StandInDb:
    """A MOOSDB of one community, in a thread of its own. A context manager.

    Args:
        community: its name.
        port: on 127.0.0.1; 0: a free one.
        warp: MOOSTimeWarp.
        hear: told every variable that is written, with the lock held.

    Attributes:
        port: as opened.
        latest: last message of each variable.
        refused: posts dropped for their type, by variable.
        frozen: set: it neither reads nor writes, its sockets stay open.
        lock: held while anything in it changes.

    Raises:
        OSError: the port is taken.
    """

    def __init__(
        self, community: str, port: int = 0, warp: float = 1.0, hear: Callable[[Message], None] = lambda message: None
    ) -> None:
        self.community, self.warp, self._hear = community, warp, hear
        self._server = socket.create_server(("127.0.0.1", port))
        self._server.setblocking(False)
        self.port = int(self._server.getsockname()[1])
        self.latest: dict[str, Message] = {}
        self.refused: dict[str, int] = {}
        self.frozen = threading.Event()
        self.lock = threading.RLock()
        self._clients: dict[int, _Client] = {}
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=f"moosdb {community}", daemon=True)
        self._thread.start()

    def now_s(self) -> float:
        """MOOS time, s."""
        return time.time() * self.warp

    def clients(self) -> list[str]:
        """Names of who is connected."""
        with self.lock:
            return [client.name for client in self._clients.values() if client.name]

    def post(self, key: str, value: float | str, source: str, time_s: float | None = None) -> None:
        """Write a variable as an app of this machine would."""
        stamp = self.now_s() if time_s is None else time_s
        message = notify(key, 0.0 if not isinstance(value, str) else value, source, stamp)
        self._write(message if isinstance(value, str) else replace(message, value=float(value)))  # NaN, too: as apps do

    def close(self) -> None:
        """End it; may be called again."""
        self._ends.set()
        self.frozen.clear()
        self._thread.join()
        with self.lock:
            for client in list(self._clients.values()):
                self._drop(client)
            self._server.close()

    def __enter__(self) -> StandInDb:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _serve(self) -> None:
        while not self._ends.is_set():
            if self.frozen.is_set():
                time.sleep(LOOK_S)
                continue
            poll = select.poll()
            poll.register(self._server, select.POLLIN)
            with self.lock:
                for number, client in self._clients.items():
                    poll.register(number, select.POLLIN | (select.POLLOUT if client.waiting else 0))
            ready = [number for number, _ in poll.poll(1000.0 * LOOK_S)]
            if self.frozen.is_set():
                continue
            with self.lock:
                self._turn(ready)

    def _turn(self, ready: list[int]) -> None:
        for number in ready:
            if number == self._server.fileno():
                self._accept()
            elif number in self._clients:
                self._read(self._clients[number])
        for client in list(self._clients.values()):
            if client.waiting:
                self._flush(client)
            if time.monotonic() - client.heard_s > SILENCE_S:
                self._drop(client)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            wire, _ = self._server.accept()
            wire.setblocking(False)
            wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients[wire.fileno()] = _Client(wire)

    def _read(self, client: _Client) -> None:
        try:
            data = client.wire.recv(1 << 16)
            if not data:
                self._drop(client)
                return
            if len(client.opening) < len(PROTOCOL):
                data = client.opening + data
                client.opening, data = data[: len(PROTOCOL)], data[len(PROTOCOL) :]
                if client.opening.lower() != PROTOCOL.lower():
                    self._drop(client)
                    return
            for packet in client.reader.feed(data):
                client.heard_s = time.monotonic()
                for message in packet:
                    self._take(client, message)
        except (BlockingIOError, InterruptedError):
            return
        except (OSError, WireError):
            self._drop(client)

    def _take(self, client: _Client, message: Message) -> None:
        if message.kind == DATA and not client.name:
            self._welcome(client, message)
            return
        if message.source:  # requests count for who is named in them, heartbeats for who sent them
            client = next((other for other in self._clients.values() if other.name == message.source), client)
        if message.kind == TIMING:
            self._send(client, replace(message, value=self.now_s(), value2=0.0))
        elif message.kind == NOTIFY:
            self._write(replace(message, community=message.community or self.community))
        elif message.kind == REGISTER and message.source:
            self._subscribe(client, message.key, message.value)
        elif message.kind == UNREGISTER:
            client.periods.pop(message.key, None)
        elif message.kind == WILDCARD:
            asked = dict(part.partition("=")[::2] for part in message.text.split(","))
            pattern = (asked.get("AppPattern", "*"), asked.get("VarPattern", "*"), float(asked.get("Interval", 0.0)))
            client.patterns.append(pattern)
            for known in list(self.latest.values()):
                self._match(client, known, pattern)

    def _welcome(self, client: _Client, message: Message) -> None:
        if message.text in self.clients():
            text = f'A client of this name ("{message.text}") already exists'
            self._send(client, Message(POISON, data=STRING, text=text))
            self._drop(client)
            return
        client.name = message.text
        skew_s = self.now_s() - message.time_s
        welcome = Message(WELCOME, time_s=self.now_s(), value=skew_s, text="asynchronous", community=self.community)
        self._send(client, replace(welcome, source_aux="hostname=stand-in"))

    def _subscribe(self, client: _Client, key: str, period_s: float) -> None:
        client.periods[key] = period_s
        if key in self.latest:
            self._send(client, replace(self.latest[key], number=-1))

    def _match(self, client: _Client, message: Message, pattern: tuple[str, str, float]) -> None:
        app, variable, period_s = pattern
        if fnmatch.fnmatchcase(message.key, variable) and fnmatch.fnmatchcase(message.source, app):
            self._subscribe(client, message.key, period_s)

    def _write(self, message: Message) -> None:
        with self.lock:
            known = self.latest.get(message.key)
            if known is not None and known.data != message.data:
                self.refused[message.key] = self.refused.get(message.key, 0) + 1
                return
            if known is None:
                for client in self._clients.values():
                    for _, variable, period_s in client.patterns:
                        if fnmatch.fnmatchcase(message.key, variable):
                            client.periods.setdefault(message.key, period_s)
            self.latest[message.key] = replace(message, community=message.community or self.community)
            self._hear(message)
            for client in list(self._clients.values()):
                self._deliver(client, self.latest[message.key])

    def _deliver(self, client: _Client, message: Message) -> None:
        period_s = client.periods.get(message.key)
        if period_s is None:
            return
        now_s = self.now_s()
        if period_s > 0.0 and now_s - client.delivered_s.get(message.key, -1e30) < period_s:
            return
        client.delivered_s[message.key] = now_s
        self._send(client, message)

    def _send(self, client: _Client, message: Message) -> None:
        client.waiting += pack_packet([message])
        self._flush(client)
        if len(client.waiting) > MOST_WAITING:
            self._drop(client)

    def _flush(self, client: _Client) -> None:
        if self.frozen.is_set():
            return
        try:
            while client.waiting:
                del client.waiting[: client.wire.send(client.waiting)]
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            client.waiting.clear()

    def _drop(self, client: _Client) -> None:
        self._clients.pop(client.wire.fileno(), None)
        client.wire.close()
