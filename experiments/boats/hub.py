"""The position feed: where all simulated boats are, as a GPS hub ashore would send it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

from steerclear.shield.bridge.feed_packets import Fix
from steerclear.shield.bridge.feed_sender import FeedSender
from steerclear.shield.bridge.frame import FieldFrame

from .boat import Boat
from .sensing import Snapshot

SENDER = "gps_hub"
_KEPT = 100
_ERROR_M, _ERROR_PER_NOISE_M = 0.05, 0.25
"""Bound of a fix's error: what rounding makes, and three times the sensors' spread."""


class PositionHub:
    """Sends the positions of boats to the feed's listeners.

    Args:
        to: HOST:PORT of each listener.
        frame: where the field is.
        noise: of the sensors, for the declared error.
        key: the signing key, so that packets are sealed; None: they are not.

    Raises:
        ConfigError: an address of another form.
    """

    def __init__(self, to: Iterable[str], frame: FieldFrame, noise: float, key: bytes | None = None) -> None:
        self._sender = FeedSender(SENDER, to, key)
        self._frame = frame
        self._error_m = _ERROR_M + _ERROR_PER_NOISE_M * noise
        self._past: dict[str, deque[Snapshot]] = {}

    def send(self, boats: Iterable[Boat], now_s: float) -> None:
        """Send where they are now; boats whose faults hide them are left out."""
        fixes = []
        for boat in boats:
            past = self._past.setdefault(boat.spec.name, deque(maxlen=_KEPT))
            past.append(boat.faults.sensed(boat.seen, now_s))
            late = boat.faults.feed_late_s
            seen = next((old for old in reversed(past) if old.time_s <= now_s - late), None)
            if seen is not None and not boat.faults.is_hidden:
                fixes.append(self._fix(boat.spec.name, seen, now_s))
        self._sender.send_positions(fixes)

    def close(self) -> None:
        """Give the sockets back."""
        self._sender.close()

    def _fix(self, name: str, seen: Snapshot, now_s: float) -> Fix:
        return Fix(
            boat=name,
            latitude_deg=seen.latitude_deg,
            longitude_deg=seen.longitude_deg,
            heading_deg=math.degrees(self._frame.heading_to_true_rad(seen.heading_rad)),
            speed_mps=seen.speed_mps,
            age_s=max(0.0, now_s - seen.time_s),
            error_m=self._error_m,
        )
