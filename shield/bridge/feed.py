"""`FeedReceiver` hears positions and the state of the game over UDP; `FeedSender` sends them.

What is in a packet: `feed_packets`; who may send: `feed_seal`; which packets count: `feed_order`.
"""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from types import TracebackType

from ..compat import Self
from ..exceptions import FeedError
from .clock import Clock
from .contact import TELEMETRY, Alarm, Contact
from .feed_contacts import MAX_SOURCES, Told
from .feed_order import GONE_S, RIVALS, Budget, Order
from .feed_packets import MAX_BYTES, BoatStatus, Fix, FlagStatus, GameState, Packet, game_state, parse_packet
from .feed_seal import Seal, body_of, is_sealed
from .feed_sender import FeedSender
from .feed_sockets import hearing_socket, is_among, network_of, socket_address
from .frame import FieldFrame
from .mavlink.signing import SigningClock

__all__ = [
    "BoatStatus",
    "FeedReceiver",
    "FeedSender",
    "Fix",
    "FlagStatus",
    "GameState",
    "Packet",
    "game_state",
    "parse_packet",
    "socket_address",
]

logger = logging.getLogger(__name__)

PACKETS_PER_S = 1000.0
"""Packets read a second; when more come the rest is thrown away, so that a flood takes no time from the loop."""
FAR_M = 20_000.0
"""A boat further from the field than this is an error of the sender."""
_SEAL_TEXTS = {
    "unsigned": "packet without a seal; the file has signing, so give its sender the key",
    "bad_signature": "packet sealed with another key, or changed on its way",
    "signed": "sealed packet, and the file has no signing; give it the key, or send without",
}
FORGED_COST = 0.1
"""What reading a packet costs that is not sealed as it should be: it is not looked into."""
_PAUSE_S = 0.02
LATE_S = 0.5
"""Sealed packets later than this, beside the sender's quickest, are told."""


class FeedReceiver:
    """Hears the feed on a socket of its own, in a thread of its own. A `ContactSource`; a context manager.

    The age of a fix is counted on our clock from its receipt, plus the age its sender declared, plus, where packets are
    sealed, how much later they come than the sender's quickest: senders' clocks are never trusted. Packets that are
    malformed, old, repeated, too long, from hosts not allowed, not sealed as they should be, or more than can be read
    are dropped and counted in `faults`. Senders that contradict each other about a
    boat are all given, each as a contact of its own: who takes them in must be right whichever of them is.

    Args:
        listen: HOST:PORT to hear at; port 0 takes a free one, see ``address``.
        frame: the field's frame.
        clock: clock of all times here.
        allow: hosts (addresses or networks) packets are taken from.
        boats: names that fixes are taken of; None takes all.
        key: the 32-byte signing key: packets must be sealed with it; None: they must not be sealed.

    Raises:
        BridgeError: the address cannot be heard at.
        ConfigError: ``listen`` or ``allow`` is no address, or the key has another length.
    """

    def __init__(
        self,
        listen: str,
        frame: FieldFrame,
        clock: Clock,
        allow: Iterable[str] = ("127.0.0.1",),
        boats: Collection[str] | None = None,
        key: bytes | None = None,
    ) -> None:
        self._frame = frame
        self._clock = clock
        self._boats = None if boats is None else frozenset(boats)
        self._allowed = tuple(network_of(host) for host in allow)
        self._lock = threading.Lock()
        self._told = Told()
        self._rival = ("", -math.inf)
        self._rivals = Told()
        self._game: GameState | None = None
        self._game_s = -math.inf
        self._faults: Counter[str] = Counter()
        self._texts: dict[str, str] = {}
        self._seal = None if key is None else Seal(key)
        self._order = Order(None if key is None else SigningClock())
        self._budget = Budget(PACKETS_PER_S)
        self._closing = threading.Event()
        self._closed = False
        self._socket = hearing_socket(listen)
        host, port = self._socket.getsockname()[:2]
        self.address = f"{host}:{port}"
        """HOST:PORT heard at."""
        self._thread = threading.Thread(target=self._hear, name="feed", daemon=True)
        self._thread.start()

    def read(self) -> Sequence[Contact]:
        """The latest contact of each boat by each sender; of one boat who speaks and was heard first comes first."""
        now_s = self._clock.now_s()
        with self._lock:
            return self._told.contacts(now_s)

    def rivals(self) -> Sequence[Contact]:
        """The same of programs that send under the name of one that speaks: they are not it, but may be right."""
        now_s = self._clock.now_s()
        with self._lock:
            return self._rivals.contacts(now_s)

    def alarms(self) -> Sequence[Alarm]:
        """Two programs under one name, or more senders of a boat than can be weighed against each other."""
        now_s = self._clock.now_s()
        with self._lock:
            text, at_s = self._rival
            rivals = [Alarm(f"feed: {text}")] if now_s - at_s < GONE_S else []
            crowded = {*self._told.crowded(now_s), *self._rivals.crowded(now_s)}
        return (
            *rivals,
            *(Alarm(f"more than {MAX_SOURCES} senders tell of it", boat, lost=True) for boat in sorted(crowded)),
        )

    def game(self) -> GameState | None:
        """The latest state of the game; None: none yet."""
        with self._lock:
            return self._game

    def game_age_s(self) -> float:
        """Time since it was received, s; inf: none yet."""
        with self._lock:
            return self._clock.now_s() - self._game_s

    def faults(self) -> dict[str, int]:
        """How many packets, fixes or boats were refused so far, by kind."""
        with self._lock:
            return dict(self._faults)

    def fault_texts(self) -> dict[str, str]:
        """The last explanation of each kind of fault."""
        with self._lock:
            return dict(self._texts)

    def take(self, data: bytes, host: str) -> None:
        """Take one datagram as if it had come from ``host``; never raises on what is in it."""
        now_s = self._clock.now_s()
        if not is_among(host, self._allowed):
            self._refuse("foreign", f"packet from {host}, which feed.allow does not name")
            return
        kind = self._seal_fault(data)
        if kind:
            self._refuse(kind, f"{host}: {_SEAL_TEXTS[kind]}")
            return
        try:
            packet = parse_packet(data if self._seal is None else body_of(data))
        except FeedError as error:
            self._refuse("malformed", f"{host}: {error}")
            return
        problem = self._out_of_place(packet) or self._order.problem(packet, now_s)
        if problem is not None:
            self._refuse(*problem)
            if problem[0] in RIVALS:
                self._note_rival(packet, problem[1], now_s)
            return
        for text in packet.refused:
            self._refuse("fix", f"{packet.sender}: {text}")
        late_s = self._order.late_s(packet.sender)
        if late_s > LATE_S:
            self._refuse("late", f"packets of {packet.sender} come {late_s:.1f} s late: what is in them is as old")
        if packet.game is not None:
            with self._lock:
                self._game, self._game_s = packet.game, now_s - late_s
        for fix in packet.fixes:
            self._take_fix(self._told, fix, packet.sender, now_s, late_s)

    def _out_of_place(self, packet: Packet) -> tuple[str, str] | None:
        """Why a packet is none for us whoever sent it, as (kind, explanation): looked at first, so it takes no seat."""
        if packet.sender == TELEMETRY:
            return "sender", f"{TELEMETRY} is no name for a sender; take another"
        strangers = set() if packet.game is None or self._boats is None else set(packet.game.boats) - self._boats
        if strangers:
            return "unknown boat", f"{packet.sender}: the game has {', '.join(sorted(strangers))}, not of this fleet"
        return None

    def _note_rival(self, packet: Packet, text: str, now_s: float) -> None:
        with self._lock:
            self._rival = (text, now_s)
        for fix in packet.fixes:
            self._take_fix(self._rivals, fix, f"{packet.sender} (run {packet.run})", now_s)

    def close(self) -> None:
        """Give the socket back; may be called again."""
        closed = self._closed
        self._closing.set()
        with contextlib.suppress(OSError):  # a datagram of its own wakes the thread; else its wait ends soon by itself
            self._socket.sendto(b"", self._socket.getsockname())
        self._thread.join(timeout=2.0)
        self._socket.close()
        faults, self._closed = self.faults(), True
        if faults and not closed:
            logger.warning("feed: refused in all: %s", ", ".join(f"{count} {kind}" for kind, count in faults.items()))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _hear(self) -> None:
        while not self._closing.is_set():
            try:
                data, source = self._socket.recvfrom(MAX_BYTES + 1)
            except TimeoutError:
                continue
            except OSError as error:  # the network went away; the ages of what was heard tell
                self._refuse("socket", str(error))
                self._closing.wait(_PAUSE_S)
                continue
            if self._closing.is_set():
                return
            if self._budget.take(time.monotonic(), FORGED_COST if self._seal_fault(data) else 1.0):
                self.take(data, str(source[0]))
            else:
                self._drop_flood()

    def _seal_fault(self, data: bytes) -> str:
        if self._seal is None:
            return "signed" if is_sealed(data) else ""
        return self._seal.fault(data)

    def _drop_flood(self) -> None:
        """Rest, then throw away what has come meanwhile: read later it would seem younger than it is."""
        self._closing.wait(_PAUSE_S)
        dropped = 1
        self._socket.setblocking(False)
        try:
            for _ in range(2000):
                self._socket.recv(1)
                dropped += 1
        except OSError:
            pass
        finally:
            self._socket.settimeout(0.2)
        self._refuse("flood", f"more than {PACKETS_PER_S:g} packets a second", dropped)

    def _take_fix(self, told: Told, fix: Fix, sender: str, now_s: float, late_s: float = 0.0) -> None:
        is_known = told.has_room(fix.boat) if self._boats is None else fix.boat in self._boats
        if not is_known:
            self._refuse("unknown boat", f"{sender}: boat {fix.boat} is not of this fleet")
            return
        x_m, y_m = self._frame.to_field_m(fix.latitude_deg, fix.longitude_deg)
        if not math.hypot(x_m, y_m) <= FAR_M:
            self._refuse("fix", f"{sender}: {fix.boat} is {math.hypot(x_m, y_m) / 1e3:.0f} km from the field")
            return
        contact = Contact(
            boat=fix.boat,
            position_m=(x_m, y_m),
            heading_rad=self._frame.heading_to_field_rad(math.radians(fix.heading_deg)),
            speed_mps=fix.speed_mps,
            fixed_s=now_s - fix.age_s - late_s,
            error_m=fix.error_m,
            source=sender,
        )
        with self._lock:
            told.take(contact, now_s)

    def _refuse(self, kind: str, text: str, times: int = 1) -> None:
        with self._lock:
            first = kind not in self._faults
            self._faults[kind] += times
            self._texts[kind] = text
        if first:
            logger.warning("feed: %s; more of this kind is only counted", text)
