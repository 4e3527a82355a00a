"""`StandInPid`: when a PID of MOOS obeys, as pMarinePID was measured to; its control law is the platform's own.

`StandInActuators` is what a boat has behind it whose PID is made to post *_PRECBF.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...platforms import Platform
from ...platforms import layout as L
from .drivers import OVERRIDES
from .gates import SUFFIX, Autopilot, HelmGate, PidGate
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
        if message.key not in HelmGate.outputs or message.data != DOUBLE or not abs(now_s - message.time_s) < SKEW_S:
            return
        self.broken = self.broken or not math.isfinite(message.value)
        self.heard_s = now_s
        setattr(self, "heading_deg" if message.key == "DESIRED_HEADING" else "speed_mps", message.value)

    def command(self, now_s: float) -> tuple[float, float] | None:
        """Heading, deg true, and speed, m/s, that it steers by now; None: thrust off."""
        tardy = now_s - self.heard_s > TARDY_S
        return None if tardy or self.overridden or self.broken else (self.heading_deg, self.speed_mps)


class StandInActuators:
    """Rudder and thrust that obey the plain names, and the control law of the PID that posts *_PRECBF before them.

    As uSimMarine, they keep what they were last told, however old it is.

    Args:
        platform: of the boat.
        dt_s: between two looks of the PID, s.

    Attributes:
        rudder, thrust: as last told, percent.

    Raises:
        ConfigError: the platform has no rudder and thrust.
    """

    def __init__(self, platform: Platform, dt_s: float) -> None:
        self._autopilot = Autopilot(platform, dt_s)
        self.rudder = self.thrust = 0.0
        self._heard_s = -math.inf

    def hear(self, message: Message, now_s: float) -> None:
        """A variable was written at MOOS time ``now_s``."""
        if message.key in PidGate.outputs and message.data == DOUBLE and math.isfinite(message.value):
            self._heard_s = now_s
            setattr(self, "rudder" if message.key == "DESIRED_RUDDER" else "thrust", message.value)

    def is_driven(self, now_s: float) -> bool:
        """Whether somebody posts the plain names at this moment."""
        return now_s - self._heard_s <= TARDY_S

    def wants(self, command: tuple[float, float] | None, heading_deg: float, speed_mps: float) -> dict[str, float]:
        """What the PID posts for a heading, deg, and a speed, m/s; thrust off without a command.

        Args:
            command: heading and speed to hold; None: nobody commands.
            heading_deg: of the boat, in the same frame.
            speed_mps: of the boat.
        """
        values = (0.0, 0.0)
        if command is None:
            self._autopilot.row[[L.RUDDER, L.THRUST]] = values
        else:
            values = self._autopilot.step(*command, heading_deg, speed_mps)
        return {f"{name}{SUFFIX}": value for name, value in zip(PidGate.outputs, values, strict=True)}
