"""Which packets of the feed count: each sender's newest only, one referee at a time, and no more than can be taken."""

from __future__ import annotations

from dataclasses import dataclass, field

from .feed_packets import Packet

MAX_SENDERS = 64
OLD_RUNS = 64
"""Earlier starts of a sender that are remembered, so that a late packet of one is not taken for a new start."""
REFEREE_GONE_S = 5.0
"""A second referee is listened to once the first has been silent this long."""


@dataclass
class _Sender:
    run: int
    seq: int
    old_runs: list[int] = field(default_factory=list)


class Order:
    """Remembers the last packet of each sender."""

    def __init__(self) -> None:
        self._senders: dict[str, _Sender] = {}
        self._referee = ""
        self._referee_s = 0.0

    def problem(self, packet: Packet, now_s: float) -> tuple[str, str] | None:
        """Why a packet does not count, as (kind, explanation), or None: then it is the newest from now on.

        Args:
            packet: the packet.
            now_s: time it was received, s.
        """
        other = packet.game is not None and self._referee not in ("", packet.sender)
        if other and now_s - self._referee_s < REFEREE_GONE_S:
            return "second referee", f"{packet.sender} speaks while {self._referee} does; end one of them"
        found = self._step(packet)
        if found is None and packet.game is not None:
            self._referee, self._referee_s = packet.sender, now_s
        return found

    def _step(self, packet: Packet) -> tuple[str, str] | None:
        sender = self._senders.get(packet.sender)
        if sender is None:
            if len(self._senders) >= MAX_SENDERS:
                return "sender", f"{packet.sender} is one sender too many, {MAX_SENDERS} at most"
            self._senders[packet.sender] = _Sender(packet.run, packet.seq)
            return None
        if packet.run != sender.run:
            if packet.run in sender.old_runs:
                return "old", f"packet of an earlier start of {packet.sender}"
            sender.old_runs = [*sender.old_runs[-OLD_RUNS:], sender.run]
            sender.run, sender.seq = packet.run, packet.seq
            return None
        if packet.seq <= sender.seq:
            kind = "repeated" if packet.seq == sender.seq else "old"
            return kind, f"{packet.sender} sends seq {packet.seq} after {sender.seq}; give each start its own 'run'"
        sender.seq = packet.seq
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

    def take(self, now_s: float) -> bool:
        """Whether one more event fits now."""
        if now_s > self._at_s:
            self._left = min(self._per_s, self._left + (now_s - self._at_s) * self._per_s)
            self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
