"""`Endpoint`: one wire, shared by all boats whose system ids answer on it, with one thread that reads.

What a wire brings is cut into frames, checked, and told to those it concerns; what cannot be believed is refused and
counted by kind.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable
from multiprocessing.connection import wait
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError
from ..clock import Clock
from .framing import Framer, source
from .signing import SignatureCheck, Signing, SigningClock
from .transport import Peer, Wire, make_wire, parse_address

LOG = logging.getLogger(__name__)

GROUND_SYSTEM = 255  # the system id ArduPilot's ground station failsafe listens to unless told otherwise
GROUND_COMPONENT = int(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
AUTOPILOT = int(mavlink.MAV_COMP_ID_AUTOPILOT1)
HEARTBEAT_S = 1.0
MOVES_AFTER_S = 3.0  # a boat may come from another address once its old one has been silent that long
ECHO_S = 3.0  # an echo is back within this time; the same bytes later are old commands that somebody plays again
_POLL_S, _REOPEN_S, _BURST, _TOLD, _SENDERS, _MOST_KEPT = 0.05, 1.0, 256, 5, 64, 4096

OnBytes = Callable[[str, bytes, int], None]
"""Called with "in" or "out", a whole frame, and unix time in microseconds: for a tlog."""


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


class Codec:
    """Messages to bytes and back: one sender's numbering and signing, and what is refused of what comes in.

    Radios and routers reflect: what we sent comes back. By its ids alone it cannot be told from another program that
    took the same ids, and that one would be a second commander; by its bytes it can. ArduPilot counts heartbeats of
    system 255 for its ground station failsafe.

    Attributes:
        source: our system and component.
        signs: whether signing is on.
    """

    def __init__(self, system: int, component: int, signing: Signing | None) -> None:
        self.source, self.signs = (system, component), signing is not None
        self._writer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._reader = mavlink.MAVLink(None)
        self._lock = threading.Lock()
        self._clock = SigningClock()
        self._check = None if signing is None else SignatureCheck(signing.key, self._clock)
        self._sent: OrderedDict[bytes, float] = OrderedDict()
        if signing is not None:
            self._writer.signing.secret_key = signing.key
            self._writer.signing.link_id = signing.link_id
            self._writer.signing.sign_outgoing = True

    def encode(self, message: Any) -> bytes:
        """Bytes of the next message; may be called from any thread."""
        with self._lock:
            if self.signs:
                self._writer.signing.timestamp = self._clock.take()
            frame = bytes(message.pack(self._writer))
            self._writer.seq = (self._writer.seq + 1) % 256
            self._sent[frame] = time.monotonic()
            self._sent.move_to_end(frame)
            if len(self._sent) > _MOST_KEPT:
                self._sent.popitem(last=False)
        return frame

    def is_echo(self, message: Any) -> bool:
        """Whether exactly this frame left lately."""
        frame = message.get_msgbuf()
        with self._lock:
            left_s = self._sent.get(b"" if frame is None else bytes(frame), -ECHO_S)
        return time.monotonic() - left_s < ECHO_S

    def decode(self, frame: bytes) -> tuple[Any, str]:
        """The message in a whole frame, or None and the kind of fault."""
        if self._check is not None:
            with self._lock:
                refused = self._check.refuse(frame)
            if refused:
                return None, refused
        try:
            return self._reader.decode(bytearray(frame)), ""
        except Exception:  # a decoder that trips over hostile bytes must not end the link
            return None, "undecodable"


class Endpoint:
    """One wire.

    Args:
        address: such as ``udpin:127.0.0.1:14550``; see `transport.parse_address`.
        clock: stamps what comes in.
        signing: sign what goes out, refuse what comes in unsigned, wrongly signed or again.
        on_bytes: gets every whole frame, refused ones too.

    Attributes:
        faults: what was refused or went wrong on this wire, by kind.

    Raises:
        LinkError: the address is none.
    """

    def __init__(
        self, address: str, clock: Clock, *, signing: Signing | None = None, on_bytes: OnBytes | None = None
    ) -> None:
        self.address, self.clock = parse_address(address), clock
        self.codec = Codec(GROUND_SYSTEM, GROUND_COMPONENT, signing)
        self.faults: Counter[str] = Counter()
        self.is_open = False
        self._wire: Wire = make_wire(self.address)
        self._receivers: dict[int, Receiver] = {}  # replaced as a whole, never changed
        self._places: dict[int, tuple[Peer, float]] = {}
        self._framers: dict[Peer, Framer] = {}
        self._on_bytes = on_bytes
        self._lock = threading.RLock()
        self._thread: threading.Thread | None = None
        self._ending = threading.Event()
        self._wake = (-1, -1)
        self._heartbeat_s, self._lost_s = -HEARTBEAT_S, -_REOPEN_S

    @property
    def port(self) -> int:
        """The port we listen at: the one given, or the free one chosen for port 0."""
        return self._wire.port or self.address.number

    def open(self) -> None:
        """Take the wire; nothing is sent yet. May be called again.

        Raises:
            LinkError: it cannot be opened: the port is taken, nobody answers, there is no such device.
        """
        with self._lock:
            if not self.is_open:
                self._wire.open()
                self.is_open = True

    def attach(self, system_id: int, receiver: Receiver) -> None:
        """Open and run, if that is not done yet, and tell this receiver about the boat of that system id.

        Raises:
            LinkError: as `open`, or another link has that system id here.
        """
        with self._lock:
            if self._receivers.get(system_id, receiver) is not receiver:
                raise LinkError(
                    f"two links want system id {system_id} on {self.address}; give each boat its own SYSID_THISMAV"
                )
            self.open()
            self._receivers = {**self._receivers, system_id: receiver}
            if self._thread is None:
                self._ending.clear()
                self._wake = os.pipe()
                self._thread = threading.Thread(target=self._run, name=f"mavlink {self.address}", daemon=True)
                self._thread.start()

    def detach(self, system_id: int) -> None:
        """Tell nobody about that boat any more; the wire is given back with the last."""
        with self._lock:
            left = {key: value for key, value in self._receivers.items() if key != system_id}
            self._receivers = left
            self._places.pop(system_id, None)
        if not left:
            self.close()

    def send(self, system_id: int, message: Any) -> bool:
        """Send to where that boat was last heard; never waits.

        Returns:
            Whether bytes left this machine.
        """
        if not self.is_open:
            return False
        with self._lock:  # numbering, signing time stamps and the wire must agree in order
            frame = self.codec.encode(message)
            sent = self._wire.send(frame, self._place(system_id))
        if sent:
            self._record("out", frame)
        return sent

    def close(self) -> None:
        """End the thread and give the wire back; may be called again."""
        self._ending.set()
        with self._lock:
            if self._wake[1] >= 0:
                os.write(self._wake[1], b"x")
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(5.0)
        with self._lock:
            self._thread = None
            self._wire.close()
            self.is_open = False
            for end in self._wake:
                if end >= 0:
                    os.close(end)
            self._wake = (-1, -1)

    def take(self, data: bytes, peer: Peer, received_s: float) -> None:
        """Bytes came in; runs on the wire's thread only."""
        framer = self._framers.get(peer)
        if framer is None:
            if len(self._framers) >= _SENDERS:  # a sender that changes its port for each packet must not fill memory
                self._framers.pop(next(iter(self._framers)))
            framer = self._framers[peer] = Framer(self._wire.datagrams)
        damaged, unknown = framer.damaged, framer.unknown
        for frame in framer.feed(data):
            self._record("in", frame)
            self._dispatch(frame, peer, received_s)
        if framer.unknown > unknown:
            self.faults["unknown_message"] += framer.unknown - unknown
        if framer.damaged > damaged:
            self.faults["bad_checksum"] += framer.damaged - damaged
            for receiver in self._receivers.values():
                receiver.on_refused("bad_checksum", framer.damaged - damaged)

    def _dispatch(self, frame: bytes, peer: Peer, received_s: float) -> None:
        """Decode and verify a whole frame, and tell whom it concerns."""
        system, component = source(frame)
        own = self._receivers.get(system)
        message, refused = self.codec.decode(frame)
        is_autopilot = own is not None and component == AUTOPILOT
        if not refused and is_autopilot and self._wire.many:
            known = self._places.get(system)  # a second address that speaks while the first does is not believed
            if known is not None and known[0] != peer and received_s - known[1] < MOVES_AFTER_S:
                refused = "second_sender"
            else:
                self._places[system] = (peer, received_s)
        if refused:
            self.faults[refused] += 1
            if own is not None:
                own.on_refused(refused, 1)
        elif own is not None and is_autopilot:
            own.on_message(message, received_s)
        else:
            for other in self._receivers.values():
                other.on_foreign(message, received_s)

    def _place(self, system_id: int) -> Peer | None:
        known = self._places.get(system_id)
        return None if known is None else known[0]

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                wait([end for end in (self._wake[0], self._wire.fileno()) if end >= 0], _POLL_S)
                self._drain()
                self._tick()
            except Exception:  # whatever a receiver or the wire does, the other boats here must still be heard
                self.faults["unexpected"] += 1
                if self.faults["unexpected"] <= _TOLD:
                    LOG.exception("link %s: unexpected; the link goes on", self.address)
                self._ending.wait(_POLL_S)

    def _drain(self) -> None:
        for _ in range(_BURST):
            try:
                got = self._wire.receive()
            except OSError as error:
                LOG.warning("link %s is lost (%s); opening it again", self.address, error)
                self.faults["wire_lost"] += 1
                self._framers.clear()  # what was half received will not be finished
                return
            if got is None:
                return
            self.take(got[0], got[1], self.clock.now_s())

    def _record(self, direction: str, frame: bytes) -> None:
        if self._on_bytes is None:
            return
        try:
            self._on_bytes(direction, frame, time.time_ns() // 1000)
        except Exception as error:  # a log that fails must not cost the boats their link; the log reports on its own
            if not self.faults["log"]:
                LOG.warning("link %s: bytes are not recorded any more (%s)", self.address, error)
            self.faults["log"] += 1

    def _tick(self) -> None:
        if self._wire.fileno() < 0 and time.monotonic() - self._lost_s >= _REOPEN_S:
            self._lost_s = time.monotonic()
            try:
                self._wire.open(_REOPEN_S)
            except LinkError as error:
                LOG.info("%s", error)
        now_s, receivers = self.clock.now_s(), self._receivers
        if now_s - self._heartbeat_s >= HEARTBEAT_S:  # without it some autopilots send nothing, and others fail safe
            self._heartbeat_s = now_s
            message = mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
            systems = {self._place(system) if self._wire.many else None: system for system in reversed(receivers)}
            for system in reversed(systems.values()):  # to each place once
                self.send(system, message)
        for receiver in receivers.values():
            receiver.on_tick(now_s)
