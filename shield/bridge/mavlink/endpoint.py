"""`Endpoint`: one wire, shared by all boats whose system ids answer on it, with one thread that reads."""

from __future__ import annotations

import logging
import os
import selectors
import threading
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError
from ..clock import Clock
from .addresses import parse_address
from .codec import Codec
from .reception import Receiver, Reception
from .serial_port import SerialWire
from .signing import Signing
from .sockets import Peer, TcpWire, UdpWire, Wire

LOG = logging.getLogger(__name__)

GROUND_SYSTEM = 255
"""The system id ArduPilot's ground station failsafe listens to unless told otherwise."""
GROUND_COMPONENT = int(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
HEARTBEAT_S = 1.0
_POLL_S = 0.05
_REOPEN_S = 1.0
_BURST = 256
_TOLD = 5

OnBytes = Callable[[str, bytes, int], None]
"""Called with "in" or "out", a whole frame, and unix time in microseconds: for a tlog."""


class Endpoint:
    """One wire.

    Args:
        address: such as ``udpin:127.0.0.1:14550``; see `addresses`.
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
        self.address = parse_address(address)
        self.clock = clock
        self.codec = Codec(GROUND_SYSTEM, GROUND_COMPONENT, signing)
        self._wire: Wire = _make_wire(self.address)
        self._reception = Reception(
            self.codec, self._wire.datagrams, self._wire.many, lambda frame: self._record("in", frame)
        )
        self.faults = self._reception.faults
        self._on_bytes = on_bytes
        self._lock = threading.RLock()
        self._thread: threading.Thread | None = None
        self._ending = threading.Event()
        self._wake = (-1, -1)
        self._heartbeat_s = -HEARTBEAT_S
        self._lost_s: float | None = None
        self.is_open = False

    @property
    def port(self) -> int:
        """The port we listen at: the one given, or the free one chosen for port 0."""
        return int(getattr(self._wire, "port", 0)) or self.address.number

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
            if self._reception.receivers.get(system_id, receiver) is not receiver:
                raise LinkError(
                    f"two links want system id {system_id} on {self.address}; give each boat its own SYSID_THISMAV"
                )
            self.open()
            self._reception.receivers = {**self._reception.receivers, system_id: receiver}
            if self._thread is None:
                self._start()

    def detach(self, system_id: int) -> None:
        """Tell nobody about that boat any more; the wire is given back with the last."""
        with self._lock:
            left = {key: value for key, value in self._reception.receivers.items() if key != system_id}
            self._reception.receivers = left
            self._reception.peers.forget(system_id)
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
            sent = self._wire.send(frame, self._reception.peers.place(system_id))
        if sent:
            self._record("out", frame)
        return sent

    def place(self, system_id: int) -> str:
        """Where that boat is heard from, for messages."""
        peer = self._reception.peers.place(system_id)
        return str(self.address) if peer is None else f"{peer[0]}:{peer[1]}"

    def close(self) -> None:
        """End the thread and give the wire back; may be called again."""
        self._ending.set()
        self._poke()
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

    def _start(self) -> None:
        self._ending.clear()
        self._wake = os.pipe()
        self._thread = threading.Thread(target=self._run, name=f"mavlink {self.address}", daemon=True)
        self._thread.start()

    def _poke(self) -> None:
        with self._lock:
            if self._wake[1] >= 0:
                os.write(self._wake[1], b"x")

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                self._wait()
                self._drain()
                self._tick()
            except Exception:  # whatever a receiver or the wire does, the other boats here must still be heard
                self.faults["unexpected"] += 1
                if self.faults["unexpected"] <= _TOLD:
                    LOG.exception("link %s: unexpected; the link goes on", self.address)
                self._ending.wait(_POLL_S)

    def _wait(self) -> None:
        wire = self._wire.fileno()
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake[0], selectors.EVENT_READ)
            if wire >= 0:
                selector.register(wire, selectors.EVENT_READ)
            selector.select(_POLL_S)

    def _drain(self) -> None:
        for _ in range(_BURST):
            try:
                got = self._wire.receive()
            except OSError as error:
                LOG.warning("link %s is lost (%s); opening it again", self.address, error)
                self.faults["wire_lost"] += 1
                self._reception.forget_rests()
                return
            if got is None:
                return
            self._reception.take(got[0], got[1], self.clock.now_s())

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
        if self._wire.fileno() < 0:
            self._reopen()
        now_s = self.clock.now_s()
        receivers = self._reception.receivers
        if now_s - self._heartbeat_s >= HEARTBEAT_S:
            self._heartbeat_s = now_s
            self._send_heartbeat(receivers)
        for receiver in receivers.values():
            receiver.on_tick(now_s)

    def _send_heartbeat(self, receivers: dict[int, Receiver]) -> None:
        """To each place once: without it some autopilots send nothing, and others fail safe."""
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        seen: set[Peer | None] = set()
        for system in receivers:
            place = self._reception.peers.place(system) if self._wire.many else None
            if place not in seen:
                seen.add(place)
                self.send(system, message)

    def _reopen(self) -> None:
        now = time.monotonic()
        if self._lost_s is not None and now - self._lost_s < _REOPEN_S:
            return
        self._lost_s = now
        try:
            self._wire.open(_REOPEN_S)
        except LinkError as error:
            LOG.info("%s", error)


def _make_wire(address: Any) -> Wire:
    if address.kind == "serial":
        return SerialWire(address)
    return UdpWire(address) if address.kind.startswith("udp") else TcpWire(address)
