"""`Reception`: from what a wire brings to messages at those who are concerned, refusing what cannot be believed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .codec import Codec
from .framing import Framer, source
from .peers import Peers
from .sockets import Peer

AUTOPILOT = int(mavlink.MAV_COMP_ID_AUTOPILOT1)
_SENDERS = 64


class Receiver(Protocol):
    """Who an endpoint tells; always from its own thread."""

    def on_message(self, message: Any, received_s: float) -> None:
        """A message of this receiver's boat's autopilot."""

    def on_foreign(self, message: Any, received_s: float) -> None:
        """A message of somebody else on this wire."""

    def on_refused(self, kind: str, count: int) -> None:
        """Something claimed to be of this boat, or of nobody in particular, and was refused."""

    def on_tick(self, now_s: float) -> None:
        """Called some twenty times a second, for what must be done now and then."""


class Reception:
    """Runs on the wire's thread only.

    Args:
        codec: decodes and verifies.
        datagrams: whether the wire brings packets.
        many: whether several peers may send on it.
        record: gets every whole frame, refused ones too.

    Attributes:
        peers: where each boat is heard from.
        receivers: by system id; replaced as a whole, never changed.
        faults: what was refused, by kind.
    """

    def __init__(self, codec: Codec, datagrams: bool, many: bool, record: Callable[[bytes], None]) -> None:
        self.peers = Peers()
        self.receivers: dict[int, Receiver] = {}
        self.faults: Counter[str] = Counter()
        self._codec, self._datagrams, self._many, self._record = codec, datagrams, many, record
        self._framers: dict[Peer, Framer] = {}

    def take(self, data: bytes, peer: Peer, received_s: float) -> None:
        """Bytes came in."""
        framer = self._framer(peer)
        damaged, unknown = framer.damaged, framer.unknown
        for frame in framer.feed(data):
            self._record(frame)
            self._dispatch(frame, peer, received_s)
        if framer.unknown > unknown:
            self.faults["unknown_message"] += framer.unknown - unknown
        if framer.damaged > damaged:
            self._refuse_all("bad_checksum", framer.damaged - damaged)

    def forget_rests(self) -> None:
        """The wire was lost: what was half received will not be finished."""
        self._framers.clear()

    def _framer(self, peer: Peer) -> Framer:
        framer = self._framers.get(peer)
        if framer is None:
            if len(self._framers) >= _SENDERS:  # a sender that changes its port for each packet must not fill memory
                self._framers.pop(next(iter(self._framers)))
            framer = self._framers[peer] = Framer(self._datagrams)
        return framer

    def _dispatch(self, frame: bytes, peer: Peer, received_s: float) -> None:
        system, component = source(frame)
        receivers = self.receivers
        own = receivers.get(system)
        message, refused = self._codec.decode(frame)
        is_autopilot = own is not None and component == AUTOPILOT
        if not refused and is_autopilot and self._many and not self.peers.accept(system, peer, received_s):
            refused = "second_sender"
        if refused:
            self.faults[refused] += 1
            if own is not None:
                own.on_refused(refused, 1)
        elif own is not None and is_autopilot:
            own.on_message(message, received_s)
        else:
            for other in receivers.values():
                other.on_foreign(message, received_s)

    def _refuse_all(self, kind: str, count: int) -> None:
        self.faults[kind] += count
        for receiver in self.receivers.values():
            receiver.on_refused(kind, count)
