"""`MoosClient`: one connection to a MOOSDB that keeps itself up, in a thread of its own.

Who it talks to is believed alive only while it echoes heartbeats: a MOOSDB that froze, or that gave this client's mail
up because it once read too slowly, takes posts as before and says nothing.
"""

from __future__ import annotations

import contextlib
import logging
import math
import select
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ..clock import Clock
from ..mavlink.transport import place_text
from .wire import (
    NOTIFY,
    POISON,
    PROTOCOL,
    TIMING,
    WELCOME,
    Message,
    PacketReader,
    WireError,
    hello,
    notify,
    pack_packet,
    register,
    timing,
)

LOG = logging.getLogger(__name__)

BEAT_S, DEAD_S = 1.0, 3.0
"""A heartbeat leaves this often, s; without an echo for so long the MOOSDB is given up. Both are real seconds."""
DIAL_S, WELCOME_S = 2.0, 6.0
"""Patience for TCP, and for the welcome: another client that hangs while it connects holds up all for 5 s."""
RETRY_S = 0.5
LOOK_S = 0.05
MOST_WAITING = 1 << 18  # bytes that may wait to leave; then the MOOSDB does not read
MOST_READS = 64  # reads between two looks at the clock: a flood must not keep heartbeats back
WARP_OFF = 1e-3
"""MOOS time is unix time times the warp; a share of difference beyond this is another warp, not a clock that is off."""


@dataclass(frozen=True)
class Health:
    """What a client knows of its connection."""

    fault: str  # why the MOOSDB does not take our posts and answer heartbeats, in words; empty: it does
    community: str  # the MOOSDB's
    echo_age_s: float  # since its last echo, and of the last heartbeat, real s
    round_trip_s: float
    sessions: int  # connections so far, and those closed for damaged packets
    damaged: int


class _Ended(OSError):
    """The connection is of no more use; its text says why."""


class MoosClient:
    """Connects, registers, reads, beats, and does so again whenever the connection ends. Close it at the end.

    Attributes:
        warp: how many times faster than real time ``clock`` runs, as the community's MOOSTimeWarp must say.
        ahead_s: MOOS time less the loop's clock, s; NaN while it is not known.

    Args:
        name: its own; a MOOSDB takes one client of a name.
        host, port: of the MOOSDB.
        clock: the loop's.
        variables: what to register for: every write.
        hear: called for each mail with the time it came, s of ``clock``; in the client's thread.
        lost: called when a connection ends, in the client's thread.
    """

    def __init__(
        self,
        name: str,
        host: str,
        port: int,
        clock: Clock,
        variables: Sequence[str],
        hear: Callable[[Message, float], None],
        lost: Callable[[], None] = lambda: None,
    ) -> None:
        self.name, self.address = name, place_text(host, port)
        self._place, self._clock = (host, port), clock
        self.warp, self.ahead_s = float(getattr(clock, "speed", 1.0)), math.nan
        self._variables, self._hear, self._lost = tuple(variables), hear, lost
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._waiting = bytearray()
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._live, name=f"moos {self.address}", daemon=True)
        self._fault, self._said = f"MOOSDB {self.address} not asked yet", ""
        self._community = ""
        self._beat_s = self._echo_s = -math.inf
        self._beats: dict[float, float] = {}
        self._trip_s = math.nan
        self._sessions = self._damaged = 0

    def start(self) -> None:
        """Begin to connect; returns at once."""
        if not self._thread.is_alive():
            self._thread.start()

    def close(self) -> None:
        """End the connection; MOOS has no word for it but the closed socket. May be called again."""
        self._ends.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(WELCOME_S + DIAL_S)

    @property
    def connected(self) -> bool:
        """Whether posts reach a MOOSDB that answers."""
        return self._socket is not None and math.isfinite(self.ahead_s)

    def health(self) -> Health:
        """State of the connection now."""
        fault, age_s = "" if self.connected else self._fault, time.monotonic() - self._echo_s
        return Health(fault, self._community, age_s, self._trip_s, self._sessions, self._damaged)

    def clock_s(self, moos_s: float) -> float:
        """Time of the loop's clock at a MOOS time, s; NaN while that is not known."""
        return moos_s - self.ahead_s

    def post(self, values: Mapping[str, float | str]) -> bool:
        """Post variables in one packet, stamped now; never waits.

        Returns:
            Whether the packet left, or waits for nothing but the network.

        Raises:
            WireError: a number is not finite; nothing is posted.
        """
        moos_s = self._clock.now_s() + self.ahead_s
        if not self.connected or not math.isfinite(moos_s):
            return False
        return self._send([notify(key, value, self.name, moos_s) for key, value in values.items()])

    def _send(self, messages: Sequence[Message]) -> bool:
        packet = pack_packet(messages)
        with self._lock:
            if self._socket is None or len(self._waiting) + len(packet) > MOST_WAITING:
                return False
            self._waiting += packet
            return self._flush(self._socket)

    def _flush(self, wire: socket.socket) -> bool:
        """Send what waits, as far as it goes; the lock is held."""
        try:
            while self._waiting:
                del self._waiting[: wire.send(self._waiting)]
        except (BlockingIOError, InterruptedError):
            return True
        except OSError:
            return False  # the reader sees the end, too, and says why
        return True

    def _live(self) -> None:
        while not self._ends.is_set():
            try:
                with socket.create_connection(self._place, DIAL_S) as wire:
                    self._session(wire)
            except WireError as error:
                self._damaged += 1
                self._fault = f"MOOSDB {self.address} sent what is no MOOS: {error}; connection closed"
            except _Ended as error:
                self._fault = f"MOOSDB {self.address} {error}"
            except OSError as error:
                why = error.strerror or str(error) or type(error).__name__
                self._fault = f"MOOSDB {self.address}: {why}; start it, or correct the address"
            with self._lock:
                was, self._socket, self._waiting = self._socket, None, bytearray()
            self.ahead_s, self._beats = math.nan, {}
            if was is not None:
                self._lost()
            if self._fault != self._said and not self._ends.is_set():
                self._said = self._fault
                LOG.warning("%s", self._fault)
            self._ends.wait(RETRY_S)

    def _session(self, wire: socket.socket) -> None:
        """One connection until it is of no more use."""
        wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        reader = PacketReader()
        early = self._greet(wire, reader)
        wire.setblocking(False)
        with self._lock:
            self._socket, self._waiting = wire, bytearray()
        self._sessions += 1
        self._echo_s = time.monotonic()  # the welcome counts as a sign of life
        now_s = time.time() * self.warp
        self._send([self._beat(), *(register(key, self.name, now_s) for key in self._variables)])
        self._take(early)
        self._read_on(wire, reader)

    def _greet(self, wire: socket.socket, reader: PacketReader) -> list[Message]:
        """Introduce ourselves; what came after the welcome."""
        wire.sendall(PROTOCOL + pack_packet([hello(self.name, time.time() * self.warp)]))  # a MOOSDB reads it only once
        wire.settimeout(LOOK_S)
        end_s = time.monotonic() + WELCOME_S
        messages: list[Message] = []
        while not messages:
            if self._ends.is_set() or time.monotonic() > end_s:
                raise _Ended("does not answer; it is frozen, or another client hangs in its door")
            with contextlib.suppress(TimeoutError):
                if not (data := wire.recv(1 << 16)):
                    raise _Ended("hangs up; it does not take us for a MOOS client")
                messages = [message for packet in reader.feed(data) for message in packet]
        first = messages[0]
        if first.kind == POISON:
            raise _Ended(f"refuses {self.name!r}: {first.text}; end the other one")
        if first.kind != WELCOME:
            raise WireError(f"it answers a hello with a message of kind {first.kind!r}")
        self._community = first.community
        return messages[1:]

    def _read_on(self, wire: socket.socket, reader: PacketReader) -> None:
        """Read and beat until we end it."""
        while not self._ends.is_set():
            poll = select.poll()
            poll.register(wire, select.POLLIN | (select.POLLOUT if self._waiting else 0))
            poll.poll(1000.0 * LOOK_S)
            with contextlib.suppress(BlockingIOError, InterruptedError):
                for _ in range(MOST_READS):
                    if not (data := wire.recv(1 << 16)):
                        raise _Ended("closed the connection")
                    for packet in reader.feed(data):
                        self._take(packet)
            with self._lock:
                self._flush(wire)
            now_s = time.monotonic()
            if now_s - self._echo_s > DEAD_S:
                raise _Ended(f"echoes no heartbeat for {DEAD_S:g} s; connecting anew")
            if now_s - self._beat_s >= BEAT_S:
                self._send([self._beat()])
            measured = (self._clock.now_s() + self.ahead_s) / time.time()
            if abs(measured / self.warp - 1.0) >= WARP_OFF:
                mend = f"give --speed {measured:.3g}, or the mission the other warp"
                raise _Ended(f"runs at MOOSTimeWarp {measured:.3g} and this run at {self.warp:g}; {mend}")

    def _beat(self) -> Message:
        """A new heartbeat; its echo is known by its time, MOOS s."""
        self._beat_s = time.monotonic()
        stamp = time.time() * self.warp
        self._beats = {**dict(list(self._beats.items())[-4:]), stamp: self._clock.now_s()}
        return timing(stamp)

    def _take(self, messages: Sequence[Message]) -> None:
        now_s = self._clock.now_s()
        for message in messages:
            if message.kind == TIMING:
                self._take_echo(message, now_s)
            elif message.kind == NOTIFY:
                self._hear(message, now_s)

    def _take_echo(self, message: Message, now_s: float) -> None:
        sent_s = self._beats.pop(message.time_s, None)
        if sent_s is None or not math.isfinite(message.value):
            return
        self._echo_s = time.monotonic()
        self._trip_s = (now_s - sent_s) / self.warp
        ahead_s = message.value - 0.5 * (sent_s + now_s)
        # a clock that was set is taken over at once, and jitter of single echoes is smoothed
        smooth = abs(ahead_s - self.ahead_s) < 0.5 * self.warp
        self.ahead_s = 0.9 * self.ahead_s + 0.1 * ahead_s if smooth else ahead_s
        self._said = ""
