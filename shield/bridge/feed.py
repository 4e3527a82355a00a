"""The feed of positions and the state of the game over UDP: heard by `FeedReceiver`, sent by `FeedSender`.

What is in a packet, and its seal: `feed_packets`. Which packets count: each sender's newest only, one start of it and
one referee at a time. Who is heard keeps its place as long as it speaks, and no longer: nothing that anybody sends can
move a sender's place ahead of itself for good, and what was refused leaves no trace.
"""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import logging
import math
import socket
import threading
import time
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from ..exceptions import BridgeError, ConfigError, FeedError
from .clock import Clock
from .feed_packets import (
    MAX_BYTES,
    SEAL_BYTES,
    Fix,
    GameState,
    Packet,
    Seal,
    is_sealed,
    parse_packet,
    place_of,
    socket_address,
)
from .frame import FieldFrame
from .mavlink.signing import NEW_STREAM_S, TICKS_PER_S, SigningClock
from .mavlink.transport import place_text
from .messages import TELEMETRY, Alarm, Closing, Contact

LOG = logging.getLogger(__name__)

PACKETS_PER_S, FORGED_COST = 1000.0, 0.1
"""Packets read a second, so that a flood takes no time from the loop; one that is not sealed as it should be is not
looked into and costs less."""
FAR_M = 20_000.0  # a boat further from the field than this is an error of the sender
LATE_S = 0.5  # sealed packets later than this, beside the sender's quickest, are told
MAX_SENDERS, MAX_BOATS, MAX_SOURCES = 64, 256, 8
"""Senders and boats remembered; senders kept of one boat: where more speak at once nobody can tell whom to believe."""
UNLISTED_S, MOST_UNLISTED = 5.0, 16
"""A boat that is not in the file is told of for so long after its last fix, s; so many of them at once."""
GONE_S = 2.0  # a sender silent for so long may begin anew: another start of it, or a lower count, is taken then
REFEREE_GONE_S = 5.0  # a second referee is listened to once the first has been silent this long
MOST_AHEAD, REORDERED = 1000, 100
"""A count this much further than the last is not of the sender that speaks; packets this far behind may have been
overtaken on the way, older ones show that two programs count."""
DRIFT = 1e-3  # clocks go apart by less than this, s per s
BUFFER_BYTES = 1 << 18  # what the kernel keeps for us: a fraction of a second of a flood, not more
_WAKE_S, _PAUSE_S = 0.2, 0.02
_SEAL_TEXTS = {
    "unsigned": "packet without a seal; the file has signing, so give its sender the key",
    "bad_signature": "packet sealed with another key, or changed on its way",
    "signed": "sealed packet, and the file has no signing; give it the key, or send without",
}


@dataclass
class _Sender:
    """What is remembered of one sender: its last packet, and how far its clock was ahead of ours at most."""

    run: int
    seq: int
    stamp: int
    first_s: float
    heard_s: float
    ahead_s: float = -math.inf
    late_s: float = 0.0


class FeedReceiver(Closing):
    """Hears the feed on a socket of its own, in a thread of its own. A `ContactSource`; a context manager.

    The age of a fix is counted on our clock from its receipt, plus the age its sender declared, plus, where packets are
    sealed, how much later they come than the sender's quickest: senders' clocks are never trusted. Packets that are
    malformed, old, repeated, too long, from hosts not allowed, not sealed as they should be, or more than can be read
    are dropped and counted in `faults`. Senders that contradict each other about a boat are all given, each as a
    contact of its own, also a second program under the name of one that speaks: who takes them in must be right
    whichever of them is.

    Args:
        listen: HOST:PORT to hear at; port 0 takes a free one, see ``address``.
        frame: the field's frame.
        clock: clock of all times here.
        allow: hosts (addresses or networks) packets are taken from.
        boats: names that fixes are taken of; None takes all.
        key: the 32-byte signing key: packets must be sealed with it; None: they must not be sealed.

    Attributes:
        address: HOST:PORT heard at.

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
        self._frame, self._clock = frame, clock
        self._boats = None if boats is None else frozenset(boats)
        self._allowed = tuple(map(_network_of, allow))
        self._seal = None if key is None else Seal(key)
        self._stamps = None if key is None else SigningClock()
        self._lock = threading.Lock()
        self._senders: dict[str, _Sender] = {}
        self._contacts: dict[str, dict[str, tuple[Contact, float]]] = {}
        self._crowded_s: dict[str, float] = {}
        self._unlisted_s: dict[str, float] = {}
        self._rival = ("", -math.inf)
        self._game: GameState | None = None
        self._game_s = -math.inf
        self._referee = ("", -math.inf)
        self._faults: Counter[str] = Counter()
        self._texts: dict[str, str] = {}
        self._budget = Budget(PACKETS_PER_S)
        self._closing, self._closed = threading.Event(), False
        self._socket = _hearing_socket(listen)
        host, port = self._socket.getsockname()[:2]
        self.address = place_text(host, port)
        self._thread = threading.Thread(target=self._hear, name="feed", daemon=True)
        self._thread.start()

    def read(self) -> Sequence[Contact]:
        """The latest contact of each boat by each sender; of one boat who speaks and was heard first comes first."""
        gone_s, found = self._clock.now_s() - GONE_S, []
        with self._lock:
            for by_sender in self._contacts.values():
                found += sorted(by_sender.values(), key=lambda entry: entry[1] <= gone_s)
        return tuple(contact for contact, _ in found)

    def alarms(self) -> Sequence[Alarm]:
        """Two programs under one name, more senders of a boat than can be weighed, boats not in the file."""
        now_s = self._clock.now_s()
        gone_s = now_s - GONE_S
        with self._lock:
            text, at_s = self._rival
            crowded = sorted(boat for boat, crowded_s in self._crowded_s.items() if crowded_s > gone_s)
            self._unlisted_s = {boat: s for boat, s in self._unlisted_s.items() if now_s - s <= UNLISTED_S}
            unlisted = [*map(Alarm.of_unlisted, sorted(self._unlisted_s))]
        rivals = [Alarm(f"feed: {text}")] if at_s > gone_s else []
        return (
            *rivals,
            *unlisted,
            *(Alarm(f"more than {MAX_SOURCES} senders tell of it", boat, lost=True) for boat in crowded),
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
        if not self._is_allowed(host):
            return self._refuse("foreign", f"packet from {host}, which feed.allow does not name")
        if kind := self._seal_fault(data):
            return self._refuse(kind, f"{host}: {_SEAL_TEXTS[kind]}")
        try:
            packet = parse_packet(data if self._seal is None else data[:-SEAL_BYTES])
        except FeedError as error:
            return self._refuse("malformed", f"{host}: {error}")
        kind, text = self._problem(packet, now_s)
        source, late_s = packet.sender, 0.0
        if kind in ("second run", "second referee"):  # not the sender we know, but it may be the one that is right
            source = f"{packet.sender} (run {packet.run})"
            with self._lock:
                self._rival = (text, now_s)
        if kind:
            self._refuse(kind, text)
            if source == packet.sender:
                return None
        else:
            late_s = self._senders[packet.sender].late_s
        for text in packet.refused:
            self._refuse("fix", f"{packet.sender}: {text}")
        if late_s > LATE_S:
            self._refuse("late", f"packets of {packet.sender} come {late_s:.1f} s late: what is in them is as old")
        if packet.game is not None and not kind:
            with self._lock:
                self._game, self._game_s = packet.game, now_s - late_s
        for fix in packet.fixes:
            self._take_fix(fix, source, now_s, late_s)
        return None

    def close(self) -> None:
        """Give the socket back; may be called again."""
        self._closing.set()
        with contextlib.suppress(OSError):  # a datagram of its own wakes the thread; else its wait ends soon by itself
            self._socket.sendto(b"", self._socket.getsockname())
        self._thread.join(timeout=2.0)
        self._socket.close()
        faults, closed, self._closed = self.faults(), self._closed, True
        if faults and not closed:
            LOG.warning("feed: refused in all: %s", ", ".join(f"{count} {kind}" for kind, count in faults.items()))

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

    def _drop_flood(self) -> None:
        """Rest, then throw away what has come meanwhile: read later it would seem younger than it is."""
        self._closing.wait(_PAUSE_S)
        dropped = 1
        self._socket.setblocking(False)
        with contextlib.suppress(OSError):
            for _ in range(2000):
                self._socket.recv(1)
                dropped += 1
        self._socket.settimeout(_WAKE_S)
        self._refuse("flood", f"more than {PACKETS_PER_S:g} packets a second", dropped)

    def _is_allowed(self, host: str) -> bool:
        try:
            address = ipaddress.ip_address(host.partition("%")[0])
        except ValueError:
            return False
        mapped = getattr(address, "ipv4_mapped", None)  # IPv4 heard on a socket that hears both
        return any((mapped or address) in network for network in self._allowed)

    def _seal_fault(self, data: bytes) -> str:
        if self._seal is None:
            return "signed" if is_sealed(data) else ""
        return self._seal.fault(data)

    def _problem(self, packet: Packet, now_s: float) -> tuple[str, str]:
        """Why a packet does not count, as (kind, explanation), or two empty texts: then it is the newest from now on.

        What is wrong whoever sent it is looked at first, so that it takes nobody's place.
        """
        name, known = packet.sender, self._senders.get(packet.sender)
        if name == TELEMETRY:
            return "sender", f"{TELEMETRY} is no name for a sender; take another"
        strangers = set() if packet.game is None or self._boats is None else set(packet.game.boats) - self._boats
        if strangers:
            return "unknown boat", f"{name}: the game has {', '.join(sorted(strangers))}, not of this fleet"
        ahead_s = -math.inf
        if self._stamps is not None:  # a sealed packet must be later than all before of its sender, and of our time
            if packet.stamp is None:
                return "malformed", f"{name}: a sealed packet needs a stamp, in 10 us since 1 January 2015"
            if known is not None and packet.stamp <= known.stamp:
                return "replayed", f"a packet of {name} that is not later than its last"
            ahead_s = (packet.stamp - self._stamps.now()) / TICKS_PER_S
            if abs(ahead_s) > NEW_STREAM_S:
                return "old_signature", f"{name} is {ahead_s:+.0f} s from this machine's clock; set both clocks"
        referee, referee_s = self._referee
        if packet.game is not None and referee not in ("", name) and now_s - referee_s < REFEREE_GONE_S:
            return "second referee", f"{name} speaks while {referee} does; end one of them"
        if known is not None and now_s - known.heard_s < GONE_S:
            if packet.run != known.run:
                return "second run", f"two programs send as {name}; end one of them: the first is listened to"
            if packet.seq > known.seq + MOST_AHEAD or packet.seq < known.seq - REORDERED:
                return "second run", f"two programs send as {name}: seq {packet.seq} after {known.seq}; end one of them"
            if packet.seq <= known.seq:
                kind = "repeated" if packet.seq == known.seq else "old"
                return kind, f"{name} sends seq {packet.seq} after {known.seq}; give each start its own 'run'"
        self._note(packet, known, now_s, ahead_s)
        return "", ""

    def _note(self, packet: Packet, known: _Sender | None, now_s: float, ahead_s: float) -> None:
        """Remember a packet as its sender's last, and how much longer it was on its way than the quickest.

        Whoever holds packets back and hands them on later changes no bit of them: only their time tells.
        """
        name = packet.sender
        if known is None and len(self._senders) >= MAX_SENDERS:  # forget whoever is silent longest, else who came last
            silent = min(self._senders, key=lambda other: self._senders[other].heard_s)
            if now_s - self._senders[silent].heard_s < GONE_S:
                silent = max(reversed(self._senders), key=lambda other: self._senders[other].first_s)
            del self._senders[silent]
        furthest_s = ahead_s
        if known is not None and known.run == packet.run:
            furthest_s = max(ahead_s, known.ahead_s - DRIFT * max(now_s - known.heard_s, 0.0))
        late_s = furthest_s - ahead_s if math.isfinite(ahead_s) else 0.0
        first_s = now_s if known is None else known.first_s
        self._senders[name] = _Sender(packet.run, packet.seq, packet.stamp or 0, first_s, now_s, furthest_s, late_s)
        if packet.game is not None:
            self._referee = (name, now_s)

    def _take_fix(self, fix: Fix, source: str, now_s: float, late_s: float) -> None:
        x_m, y_m = self._frame.to_field_m(fix.latitude_deg, fix.longitude_deg)
        is_far = not math.hypot(x_m, y_m) <= FAR_M
        has_room = fix.boat in self._contacts or len(self._contacts) < MAX_BOATS
        if not (has_room if self._boats is None else fix.boat in self._boats):
            if self._boats is not None and not is_far:
                self._note_unlisted(fix.boat, now_s)
            return self._refuse("unknown boat", f"{source}: boat {fix.boat} is not of this fleet")
        if is_far:
            return self._refuse("fix", f"{source}: {fix.boat} is {math.hypot(x_m, y_m) / 1e3:.0f} km from the field")
        heading_rad = self._frame.heading_to_field_rad(math.radians(fix.heading_deg))
        fixed_s = now_s - fix.age_s - late_s
        contact = Contact(fix.boat, (x_m, y_m), heading_rad, fix.speed_mps, fixed_s, fix.error_m, source)
        with self._lock:
            by_sender = self._contacts.setdefault(fix.boat, {})
            if (
                source not in by_sender and len(by_sender) >= MAX_SOURCES
            ):  # it takes the place of who is silent, else came last
                silent = min(by_sender, key=lambda name: by_sender[name][1])
                if now_s - by_sender[silent][1] < GONE_S:
                    self._crowded_s[fix.boat] = now_s
                    silent = next(reversed(by_sender))
                del by_sender[silent]
            by_sender[source] = (contact, now_s)
        return None

    def _note_unlisted(self, boat: str, now_s: float) -> None:
        with self._lock:
            if boat in self._unlisted_s or len(self._unlisted_s) < MOST_UNLISTED:
                self._unlisted_s[boat] = now_s

    def _refuse(self, kind: str, text: str, times: int = 1) -> None:
        with self._lock:
            first = kind not in self._faults
            self._faults[kind] += times
            self._texts[kind] = text
        if first:
            LOG.warning("feed: %s; more of this kind is only counted", text)


class Budget:
    """Lets through so many events a second on average, and that many at once."""

    def __init__(self, per_s: float) -> None:
        self._per_s, self._left, self._at_s = per_s, per_s, -math.inf

    def take(self, now_s: float, cost: float = 1.0) -> bool:
        """Whether one more event of that cost, in events, fits now."""
        if now_s > self._at_s:
            self._left = min(self._per_s, self._left + (now_s - self._at_s) * self._per_s)
            self._at_s = now_s
        if self._left < cost:
            return False
        self._left -= cost
        return True


def _hearing_socket(listen: str) -> socket.socket:
    host, port = socket_address(listen)
    opened: socket.socket | None = None
    try:
        family, place = place_of(host, port)
        opened = socket.socket(family, socket.SOCK_DGRAM)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        opened.settimeout(_WAKE_S)
        opened.bind(place)
    except OSError as error:
        if opened is not None:
            opened.close()
        whose = "another runner? " if error.errno == errno.EADDRINUSE else ""
        raise BridgeError(
            f"cannot hear the feed at {listen} ({error.strerror or error}); {whose}end the program that uses the port, "
            "or give another address"
        ) from None
    return opened


def _network_of(host: str) -> ipaddress.IPv4Network | ipaddress.IPv6Network:
    try:
        return ipaddress.ip_network("127.0.0.1" if host == "localhost" else host, strict=False)
    except ValueError:
        raise ConfigError(f"{host!r} is no host to allow; give an address such as 127.0.0.1, or a network") from None
