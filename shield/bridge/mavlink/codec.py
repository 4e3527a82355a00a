"""Messages to bytes and back: one sender's numbering and signing, and what is refused of what comes in."""

from __future__ import annotations

import threading
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .own_frames import Source
from .signing import SignatureCheck, Signing, SigningClock


class Codec:
    """Encodes as one source system and component; decodes frames that `framing.Framer` found whole.

    Args:
        system: our system id; ArduPilot counts heartbeats of 255 for its ground station failsafe.
        component: our component id.
        signing: sign what goes out and refuse what comes in unsigned, wrongly signed or again.

    Attributes:
        source: our ids; knows what was encoded lately.
    """

    def __init__(self, system: int, component: int, signing: Signing | None) -> None:
        self.source = Source(system, component)
        self._writer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._reader = mavlink.MAVLink(None)
        self._lock = threading.Lock()
        self._clock = SigningClock()
        self._check = None if signing is None else SignatureCheck(signing.key, self._clock)
        if signing is not None:
            self._writer.signing.secret_key = signing.key
            self._writer.signing.link_id = signing.link_id
            self._writer.signing.sign_outgoing = True

    @property
    def signs(self) -> bool:
        """Whether signing is on."""
        return self._check is not None

    def encode(self, message: Any) -> bytes:
        """Bytes of the next message; may be called from any thread."""
        with self._lock:
            if self._check is not None:
                self._writer.signing.timestamp = self._clock.take()
            frame = bytes(message.pack(self._writer))
            self._writer.seq = (self._writer.seq + 1) % 256
        self.source.note(frame)
        return frame

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
