"""`HelmGate`: between the helm and the PID. It reads RAW_DESIRED_*, what the shield answers is posted as DESIRED_*.

pHelmIvP with ``helm_prefix = RAW_`` posts there, and so does any other commander that is to be filtered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

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


class Gate(Protocol):
    """Where the shield sits in a community, and what its commands look like there.

    Attributes:
        inputs, outputs: variables read and written.
        at_rest: what is posted last to a boat that is left, whose actuators would keep the command before; mostly none.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    at_rest: Mapping[str, float]

    def hear(self, message: Message, now_s: float) -> None:
        """Take mail of an input in."""

    def forget(self) -> None:
        """The connection was lost: nothing is wanted any more."""

    def nominal(self, reading: BoatReading) -> Nominal:
        """What is wanted of the boat now; a stop when nobody says."""

    def encode(self, heading_rad: float, speed_mps: float, reading: BoatReading) -> Mapping[str, float]:
        """The outputs that ask for a heading in the field, rad, and a speed, m/s."""


class Inputs:
    """The latest of some numbers, each with the time it came; what is no number is as good as silence.

    Args:
        names: of the variables.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._heard: dict[str, tuple[float, float]] = {}

    def hear(self, message: Message, now_s: float) -> None:
        """Take mail in."""
        if message.key in self._names and message.data == DOUBLE and math.isfinite(message.value):
            self._heard[message.key] = message.value, now_s

    def forget(self) -> None:
        """Nothing was heard."""
        self._heard.clear()

    def value(self, name: str) -> float:
        """The latest; NaN: none."""
        return self._heard.get(name, (math.nan, 0.0))[0]

    def silent(self, now_s: float) -> str:
        """Which of them is older than `SILENCE_S`, in words; empty: none."""
        for name in self._names:
            if name not in self._heard:
                return f"nobody posts {name}"
            age_s = now_s - self._heard[name][1]
            if age_s > SILENCE_S:
                return f"{name} has been silent for more than {SILENCE_S:g} s"
        return ""


def standstill(reading: BoatReading, fault: str) -> Nominal:
    """A stop on the present heading."""
    return Nominal(0.0, reading.heading_rad if math.isfinite(reading.heading_rad) else 0.0, fault)


class HelmGate:
    """See the module.

    Args:
        frame: of the field.
        prefix: what the helm puts before its own.
    """

    outputs: tuple[str, ...] = ("DESIRED_HEADING", "DESIRED_SPEED")
    at_rest: Mapping[str, float] = MappingProxyType({})

    def __init__(self, frame: FieldFrame, prefix: str = "RAW_") -> None:
        self.inputs: tuple[str, ...] = tuple(f"{prefix}{name}" for name in self.outputs)
        self._frame, self._inputs = frame, Inputs(self.inputs)

    def hear(self, message: Message, now_s: float) -> None:
        """Take mail of an input in."""
        self._inputs.hear(message, now_s)

    def forget(self) -> None:
        """The connection was lost: nothing is wanted any more."""
        self._inputs.forget()

    def nominal(self, reading: BoatReading) -> Nominal:
        """What the helm wants; a stop when it has been silent."""
        if fault := self._inputs.silent(reading.read_s):
            return standstill(reading, fault)
        heading_deg, speed_mps = (self._inputs.value(name) for name in self.inputs)
        return Nominal(speed_mps, self._frame.heading_to_field_rad(math.radians(heading_deg)))

    def encode(self, heading_rad: float, speed_mps: float, reading: BoatReading) -> Mapping[str, float]:
        """DESIRED_HEADING, deg true in [0, 360), and DESIRED_SPEED, m/s."""
        heading_deg = math.degrees(self._frame.heading_to_true_rad(heading_rad) % TWO_PI)
        return dict(zip(self.outputs, (heading_deg, speed_mps), strict=True))
