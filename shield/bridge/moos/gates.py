"""Where the shield sits in a boat's community: `HelmGate`, between helm and PID.

pHelmIvP with ``helm_prefix = RAW_`` posts RAW_DESIRED_*, and so does any other commander that is to be filtered; what
the shield answers is posted as DESIRED_*.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..frame import TWO_PI, FieldFrame
from ..messages import BoatReading
from .wire import DOUBLE, Message

SILENCE_S = 1.0
"""A nominal command older than this, MOOS s, is none: the boat is told to stop."""


@dataclass(frozen=True)
class Nominal:
    """What somebody else wants one boat to do.

    Attributes:
        speed_mps, heading_rad: the command, in the field's frame.
        fault: why it is a stop of ours and not his command, in words; empty: it is his.
    """

    speed_mps: float
    heading_rad: float
    fault: str = ""


class HelmGate:
    """Headings, deg true, and speeds, m/s, in and out; the helm puts ``prefix`` before its own.

    The latest of each input counts, with the time it came; what is no number is as good as silence.

    Attributes:
        inputs, outputs: variables read and written.
        prefix: as given.
    """

    outputs = ("DESIRED_HEADING", "DESIRED_SPEED")

    def __init__(self, frame: FieldFrame, prefix: str = "RAW_") -> None:
        self.inputs = tuple(f"{prefix}{name}" for name in self.outputs)
        self.prefix, self._frame = prefix, frame
        self._heard: dict[str, tuple[float, float]] = {}

    def hear(self, message: Message, now_s: float) -> None:
        """Take mail in."""
        if message.key in self.inputs and message.data == DOUBLE and math.isfinite(message.value):
            self._heard[message.key] = message.value, now_s

    def forget(self) -> None:
        """The connection was lost: nothing is wanted any more."""
        self._heard.clear()

    def nominal(self, reading: BoatReading) -> Nominal:
        """What is wanted of the boat now; a stop on its present heading when nobody says."""
        fault = ""
        for name in self.inputs:
            if name not in self._heard:
                fault = fault or f"nobody posts {name}"
            elif reading.read_s - self._heard[name][1] > SILENCE_S:
                fault = fault or f"{name} has been silent for more than {SILENCE_S:g} s"
        if fault:
            return Nominal(0.0, reading.heading_rad if math.isfinite(reading.heading_rad) else 0.0, fault)
        heading_deg, speed_mps = (self._heard[name][0] for name in self.inputs)
        return Nominal(speed_mps, self._frame.heading_to_field_rad(math.radians(heading_deg)))

    def encode(self, heading_rad: float, speed_mps: float) -> Mapping[str, float]:
        """DESIRED_HEADING, deg true in [0, 360), and DESIRED_SPEED, m/s, for a heading in the field, rad."""
        heading_deg = math.degrees(self._frame.heading_to_true_rad(heading_rad) % TWO_PI)
        return dict(zip(self.outputs, (heading_deg, speed_mps), strict=True))
