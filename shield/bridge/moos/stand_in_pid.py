"""`StandInPid`: when a PID of MOOS obeys, as pMarinePID was measured to; its control law is the platform's own."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .drivers import OVERRIDES
from .wire import DOUBLE, Message

TARDY_S = 2.0
"""A PID that hears no command for longer, MOOS s, takes thrust off."""
SKEW_S = 360.0
"""Stamps further off than this are ignored."""


@dataclass
class StandInPid:
    """Hears what is written in its MOOSDB.

    Attributes:
        heading_deg, speed_mps: as last told, deg true and m/s.
        heard_s: MOOS time of the last command, s.
        overridden: whether a hand has the boat.
        broken: whether it was told what is no number: it never recovers from that.
    """

    heading_deg: float = 0.0
    speed_mps: float = 0.0
    heard_s: float = -math.inf
    overridden: bool = False
    broken: bool = False

    def hear(self, message: Message, now_s: float) -> None:
        """A variable was written at MOOS time ``now_s``."""
        if message.key in OVERRIDES:
            self.overridden = message.text.lower() == "true"
        if message.key not in ("DESIRED_HEADING", "DESIRED_SPEED") or message.data != DOUBLE:
            return
        if not abs(now_s - message.time_s) < SKEW_S:
            return
        self.broken = self.broken or not math.isfinite(message.value)
        self.heard_s = now_s
        if message.key == "DESIRED_HEADING":
            self.heading_deg = message.value
        else:
            self.speed_mps = message.value

    def command(self, now_s: float) -> tuple[float, float] | None:
        """Heading, deg true, and speed, m/s, that it steers by now; None: thrust off."""
        tardy = now_s - self.heard_s > TARDY_S
        return None if tardy or self.overridden or self.broken else (self.heading_deg, self.speed_mps)
