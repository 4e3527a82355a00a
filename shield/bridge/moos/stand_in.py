"""Stand-ins for MOOS where it is not installed: a small MOOSDB on this machine alone, and PIDs that obey as measured.

`StandInDb` keeps what clients of ours can see of a real one: the handshake, mail to all who registered, periods, the
type of a variable fixed by its first write, heartbeats echoed, silent clients dropped. `StandInPid` says when a PID
obeys, as pMarinePID was measured to; its control law is the platform's own. `StandInActuators` is what a boat has
behind it whose PID is made to post *_PRECBF.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ...platforms import Platform
from ...platforms import layout as L
from ..messages import Closing
from .drivers import OVERRIDES
from .gates import SUFFIX, Autopilot, HelmGate, PidGate
from .wire import (
    DATA,
    DOUBLE,
    NOTIFY,
    POISON,
    PROTOCOL,
    REGISTER,
    STRING,
    TIMING,
    UNREGISTER,
    WELCOME,
    Message,
    PacketReader,
    WireError,
    notify,
    pack_packet,
)

SILENCE_S = 5.0
MOST_WAITING = 1 << 20
LOOK_S = 0.05


@dataclass(eq=False)
class _Client:
    """One connection."""

    writer: asyncio.StreamWriter
    name: str = ""
    periods: dict[str, float] = field(default_factory=dict)
    delivered_s: dict[str, float] = field(default_factory=dict)
    heard_s: float = field(default_factory=time.monotonic)

    def send(self, message: Message) -> None:
        if self.writer.transport.is_closing():
            return  # who reads finds out and drops it
        self.writer.write(pack_packet([message]))
        if self.writer.transport.get_write_buffer_size() > MOST_WAITING:
            self.writer.transport.abort()  # it does not read


class StandInDb(Closing):
    """A MOOSDB of one community, on 127.0.0.1 (port 0: a free one), in a thread of its own. A context manager.

    Attributes:
        port: as opened.
        latest: last message of each variable; ``hear`` is told each, with the lock held.
        refused: posts dropped for their type, by variable.
        frozen: set: it neither reads nor writes, its sockets stay open.

    Raises:
        OSError: the port is taken.
    """

    def __init__(
        self, community: str, port: int = 0, warp: float = 1.0, hear: Callable[[Message], None] = lambda message: None
    ) -> None:
        self.community, self.warp, self._hear = community, warp, hear
        server = socket.create_server(("127.0.0.1", port))
        self.port = int(server.getsockname()[1])
        self.latest: dict[str, Message] = {}
        self.refused: dict[str, int] = {}
        self.frozen, self._ends, self._lock = threading.Event(), threading.Event(), threading.RLock()
        self._clients: set[_Client] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve(server)), name=f"moosdb {community}", daemon=True
        )
        self._thread.start()

    def now_s(self) -> float:
        """MOOS time, s."""
        return time.time() * self.warp

    def clients(self) -> list[str]:
        """Names of who is connected."""
        return [client.name for client in list(self._clients) if client.name]

    def post(self, key: str, value: float | str, source: str, time_s: float | None = None) -> None:
        """Write a variable as an app of this machine would."""
        stamp = self.now_s() if time_s is None else time_s
        message = notify(key, value if isinstance(value, str) else 0.0, source, stamp)
        self._write(message if isinstance(value, str) else replace(message, value=float(value)))  # NaN, too: as apps do

    def close(self) -> None:
        """End it; may be called again."""
        self._ends.set()
        self._thread.join()

    async def _serve(self, socket_: socket.socket) -> None:
        self._loop = asyncio.get_running_loop()
        server = await asyncio.start_server(self._talk, sock=socket_)
        while not self._ends.is_set():
            await asyncio.sleep(LOOK_S)
            for client in list(self._clients):
                if time.monotonic() - client.heard_s > SILENCE_S:
                    client.writer.transport.abort()
            while self.frozen.is_set() and not self._ends.is_set():
                time.sleep(LOOK_S)  # all of it, as a process that is stopped
        server.close()
        while self._clients:
            for client in list(self._clients):
                client.writer.transport.abort()
            await asyncio.sleep(0.0)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client, packets = _Client(writer), PacketReader()
        self._clients.add(client)
        with contextlib.suppress(OSError, asyncio.IncompleteReadError, WireError):  # it is gone, or no client of MOOS
            if (await reader.readexactly(len(PROTOCOL))).lower() != PROTOCOL.lower():
                raise WireError("another protocol")
            while data := await reader.read(1 << 16):
                for packet in packets.feed(data):
                    client.heard_s = time.monotonic()
                    for message in packet:
                        self._take(client, message)
        self._clients.discard(client)
        writer.close()

    def _take(self, client: _Client, message: Message) -> None:
        if message.kind == DATA and not client.name:
            self._welcome(client, message)
            return
        if message.source:  # requests count for who is named in them, heartbeats for who sent them
            client = next((other for other in self._clients if other.name == message.source), client)
        if message.kind == TIMING:
            client.send(replace(message, value=self.now_s(), value2=0.0))
        elif message.kind == NOTIFY:
            self._write(message)
        elif message.kind == REGISTER and message.source:
            client.periods[message.key] = message.value
            if message.key in self.latest:
                client.send(replace(self.latest[message.key], number=-1))
        elif message.kind == UNREGISTER:
            client.periods.pop(message.key, None)

    def _welcome(self, client: _Client, message: Message) -> None:
        if message.text in self.clients():
            client.send(Message(POISON, data=STRING, text=f'A client of this name ("{message.text}") already exists'))
            raise WireError("a name that is taken")
        client.name, now_s = message.text, self.now_s()
        welcome = Message(WELCOME, time_s=now_s, value=now_s - message.time_s, text="asynchronous")
        client.send(replace(welcome, community=self.community, source_aux="hostname=stand-in"))

    def _write(self, message: Message) -> None:
        message = replace(message, community=message.community or self.community)
        with self._lock:
            known = self.latest.get(message.key)
            if known is not None and known.data != message.data:
                self.refused[message.key] = self.refused.get(message.key, 0) + 1
                return
            self.latest[message.key] = message
            self._hear(message)
        with contextlib.suppress(RuntimeError):  # it was closed
            if self._loop is not None:
                self._loop.call_soon_threadsafe(self._deliver, message)

    def _deliver(self, message: Message) -> None:
        now_s = self.now_s()
        for client in list(self._clients):
            period_s = client.periods.get(message.key)
            if period_s is not None and not now_s - client.delivered_s.get(message.key, -1e30) < period_s:
                client.delivered_s[message.key] = now_s
                client.send(message)


TARDY_S = 2.0  # a PID that hears no command for longer, MOOS s, takes thrust off
SKEW_S = 360.0  # stamps further off than this are ignored


@dataclass
class StandInPid:
    """Hears what is written in its MOOSDB."""

    heading_deg: float = 0.0  # as last told, deg true and m/s
    speed_mps: float = 0.0
    heard_s: float = -math.inf  # MOOS time of the last command, s
    overridden: bool = False  # whether a hand has the boat
    broken: bool = False  # whether it was told what is no number: it never recovers from that

    def hear(self, message: Message, now_s: float) -> None:
        """A variable was written at MOOS time ``now_s``."""
        if message.key in OVERRIDES:
            self.overridden = message.text.lower() == "true"
        if message.key not in HelmGate.outputs or message.data != DOUBLE or not abs(now_s - message.time_s) < SKEW_S:
            return
        self.broken = self.broken or not math.isfinite(message.value)
        self.heard_s = now_s
        setattr(self, "heading_deg" if message.key == "DESIRED_HEADING" else "speed_mps", message.value)

    def command(self, now_s: float) -> tuple[float, float] | None:
        """Heading, deg true, and speed, m/s, that it steers by now; None: thrust off."""
        tardy = now_s - self.heard_s > TARDY_S
        return None if tardy or self.overridden or self.broken else (self.heading_deg, self.speed_mps)


class StandInActuators:
    """Rudder and thrust that obey the plain names, and the control law of the PID that posts *_PRECBF before them.

    As uSimMarine, they keep what they were last told, however old it is.

    Args:
        platform: of the boat.
        dt_s: between two looks of the PID, s.

    Attributes:
        rudder, thrust: as last told, percent.

    Raises:
        ConfigError: the platform has no rudder and thrust.
    """

    def __init__(self, platform: Platform, dt_s: float) -> None:
        self._autopilot = Autopilot(platform, dt_s)
        self.rudder = self.thrust = 0.0
        self._heard_s = -math.inf

    def hear(self, message: Message, now_s: float) -> None:
        """A variable was written at MOOS time ``now_s``."""
        if message.key in PidGate.outputs and message.data == DOUBLE and math.isfinite(message.value):
            self._heard_s = now_s
            setattr(self, "rudder" if message.key == "DESIRED_RUDDER" else "thrust", message.value)

    def is_driven(self, now_s: float) -> bool:
        """Whether somebody posts the plain names at this moment."""
        return now_s - self._heard_s <= TARDY_S

    def wants(self, command: tuple[float, float] | None, heading_deg: float, speed_mps: float) -> dict[str, float]:
        """What the PID posts for a heading, deg, and a speed, m/s, given the boat's own; thrust off without them."""
        values = (0.0, 0.0)
        if command is None:
            self._autopilot.row[[L.RUDDER, L.THRUST]] = values
        else:
            values = self._autopilot.step(*command, heading_deg, speed_mps)
        return {f"{name}{SUFFIX}": value for name, value in zip(PidGate.outputs, values, strict=True)}
