"""Which packets of the feed count: each sender's newest only, one start of it and one referee at a time.

Who is heard keeps its place as long as it speaks, and no longer: nothing that anybody sends can move a sender's place
ahead of itself for good, and what was refused leaves no trace.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from .feed_packets import Packet
from .mavlink.signing import NEW_STREAM_S, TICKS_PER_S, SigningClock

MAX_SENDERS = 64
GONE_S = 2.0
"""A sender silent for so long may begin anew: another start of it, or a lower count, is taken then."""
REFEREE_GONE_S = 5.0
"""A second referee is listened to once the first has been silent this long."""
MOST_AHEAD = 1000
"""A count this much further than the last is not of the sender that speaks."""
REORDERED = 100
"""Packets this far behind may have been overtaken on the way; older ones show that two programs count."""
DRIFT = 1e-3
"""Clocks go apart by less than this, s per s."""
RIVALS = ("second run", "second referee")
"""Kinds that show two programs under one name, or in one office: whoever is right, both cannot be."""


@dataclass
class _Sender:
    run: int
    seq: int
    stamp: int
    first_s: float
    heard_s: float
    ahead_s: float = -math.inf
    late_s: float = 0.0


class Order:
    """Remembers the last packet of each sender.

    Args:
        clock: of time stamps, for sealed packets; None: packets have none.
    """

    def __init__(self, clock: SigningClock | None = None) -> None:
        self._clock = clock
        self._senders: dict[str, _Sender] = {}
        self._referee = ""
        self._referee_s = 0.0

    def problem(self, packet: Packet, now_s: float) -> tuple[str, str] | None:
        """Why a packet does not count, as (kind, explanation), or None: then it is the newest from now on.

        Args:
            packet: the packet.
            now_s: time it was received, s.
        """
        found = self._stamp_problem(packet)
        if found is not None:
            return found
        other = packet.game is not None and self._referee not in ("", packet.sender)
        if other and now_s - self._referee_s < REFEREE_GONE_S:
            return "second referee", f"{packet.sender} speaks while {self._referee} does; end one of them"
        known = self._senders.get(packet.sender)
        before = None if known is None else replace(known)
        found = self._step(packet, now_s)
        if found is None:
            self._note_way(packet, before, now_s)
        if found is None and packet.game is not None:
            self._referee, self._referee_s = packet.sender, now_s
        return found

    def late_s(self, sender: str) -> float:
        """How much longer the last packet of a sender was on its way than its quickest, s; 0 without stamps.

        Whoever holds packets back and hands them on later changes no bit of them: only their time tells.
        """
        known = self._senders.get(sender)
        return 0.0 if known is None else known.late_s

    def _note_way(self, packet: Packet, before: _Sender | None, now_s: float) -> None:
        """Compare how far a sender's clock is ahead with the furthest it was in this run."""
        if self._clock is None or packet.stamp is None:
            return
        known = self._senders[packet.sender]
        ahead_s = (packet.stamp - self._clock.now()) / TICKS_PER_S
        furthest_s = -math.inf
        if before is not None and before.run == packet.run:
            furthest_s = before.ahead_s - DRIFT * max(now_s - before.heard_s, 0.0)
        known.ahead_s = max(ahead_s, furthest_s)
        known.late_s = known.ahead_s - ahead_s

    def _stamp_problem(self, packet: Packet) -> tuple[str, str] | None:
        """A sealed packet must be later than all before of its sender, and of our time."""
        if self._clock is None:
            return None
        if packet.stamp is None:
            return "malformed", f"{packet.sender}: a sealed packet needs a stamp, in 10 us since 1 January 2015"
        known = self._senders.get(packet.sender)
        if known is not None and packet.stamp <= known.stamp:
            return "replayed", f"a packet of {packet.sender} that is not later than its last"
        ahead_s = (packet.stamp - self._clock.now()) / TICKS_PER_S
        if abs(ahead_s) > NEW_STREAM_S:
            return "old_signature", f"{packet.sender} is {ahead_s:+.0f} s from this machine's clock; set both clocks"
        return None

    def _step(self, packet: Packet, now_s: float) -> tuple[str, str] | None:
        known = self._senders.get(packet.sender)
        if known is None:
            self._make_room(now_s)
            self._senders[packet.sender] = _Sender(packet.run, packet.seq, packet.stamp or 0, now_s, now_s)
            return None
        if now_s - known.heard_s < GONE_S:
            found = _not_next(packet, known)
            if found is not None:
                return found
        known.run, known.seq, known.stamp, known.heard_s = packet.run, packet.seq, packet.stamp or 0, now_s
        return None

    def _make_room(self, now_s: float) -> None:
        """Forget whoever is silent longest; where all speak, whoever came last, so that nobody who was there goes."""
        if len(self._senders) < MAX_SENDERS:
            return
        silent = min(self._senders, key=lambda name: self._senders[name].heard_s)
        if now_s - self._senders[silent].heard_s >= GONE_S:
            del self._senders[silent]
        else:
            del self._senders[max(reversed(self._senders), key=lambda name: self._senders[name].first_s)]


def _not_next(packet: Packet, known: _Sender) -> tuple[str, str] | None:
    """Why a packet does not follow the last one of a sender that speaks."""
    name = packet.sender
    if packet.run != known.run:
        return "second run", f"two programs send as {name}; end one of them: the first is listened to"
    if packet.seq > known.seq + MOST_AHEAD or packet.seq < known.seq - REORDERED:
        return "second run", f"two programs send as {name}: seq {packet.seq} after {known.seq}; end one of them"
    if packet.seq <= known.seq:
        kind = "repeated" if packet.seq == known.seq else "old"
        return kind, f"{name} sends seq {packet.seq} after {known.seq}; give each start its own 'run'"
    return None


class Budget:
    """Lets through so many events a second on average, and that many at once.

    Args:
        per_s: events a second.
    """

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._left = per_s
        self._at_s = float("-inf")

    def take(self, now_s: float, cost: float = 1.0) -> bool:
        """Whether one more event fits now.

        Args:
            now_s: s.
            cost: of this event, in events.
        """
        if now_s > self._at_s:
            self._left = min(self._per_s, self._left + (now_s - self._at_s) * self._per_s)
            self._at_s = now_s
        if self._left < cost:
            return False
        self._left -= cost
        return True
