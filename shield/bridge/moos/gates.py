"""Where the shield sits in a boat's community: `HelmGate` between helm and PID, `PidGate` between PID and actuators.

pHelmIvP with ``helm_prefix = RAW_`` posts RAW_DESIRED_*, and so does any other commander that is to be filtered; what
the shield answers is posted as DESIRED_*. `PidGate` is for those who want to compare with a filter that sits there: a
PID of the community is made to post *_PRECBF, and the gate posts the plain names.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ...exceptions import ConfigError
from ...jit import Array
from ...platforms import Platform, fresh_state, step_boat
from ...platforms import layout as L
from ..frame import TWO_PI, FieldFrame
from ..messages import BoatReading
from .wire import DOUBLE, Message

SILENCE_S = 1.0  # a nominal command older than this, MOOS s, is none: the boat is told to stop
SUFFIX = "_PRECBF"
SAME = 1e-9
"""A command this near to what the PID meant, rad and m/s, is the PID's: what is left is the rounding of angles."""


@dataclass(frozen=True)
class Nominal:
    """What somebody else wants one boat to do."""

    speed_mps: float  # the command, in the field's frame
    heading_rad: float
    fault: str = ""  # why it is a stop of ours and not his command, in words; empty: it is his


class Gate:
    """What gates share: the latest of each input with the time it came; what is no number is as good as silence.

    Attributes:
        inputs, outputs: variables read and written.
        at_rest: what is posted last to a boat that is left, whose actuators would keep the command before; mostly none.
    """

    outputs: tuple[str, ...] = ()
    at_rest: Mapping[str, float] = MappingProxyType({})

    def __init__(self, inputs: tuple[str, ...]) -> None:
        self.inputs = inputs
        self._heard: dict[str, tuple[float, float]] = {}

    def hear(self, message: Message, now_s: float) -> None:
        """Take mail in."""
        if message.key in self.inputs and message.data == DOUBLE and math.isfinite(message.value):
            self._heard[message.key] = message.value, now_s

    def forget(self) -> None:
        """The connection was lost: there is no nominal command any more."""
        self._heard.clear()

    def nominal(self, reading: BoatReading) -> Nominal:
        """The boat's nominal command now; a stop on its present heading when nobody says."""
        fault = ""
        for name in self.inputs:
            if name not in self._heard:
                fault = fault or f"nobody posts {name}"
            elif reading.read_s - self._heard[name][1] > SILENCE_S:
                fault = fault or f"{name} has been silent for more than {SILENCE_S:g} s"
        if fault:
            return Nominal(0.0, reading.heading_rad if math.isfinite(reading.heading_rad) else 0.0, fault)
        first, second = (self._heard[name][0] for name in self.inputs)
        return self.meaning(first, second, reading)

    def meaning(self, first: float, second: float, reading: BoatReading) -> Nominal:
        """The command that the two inputs, both fresh, stand for."""
        raise NotImplementedError

    def encode(self, heading_rad: float, speed_mps: float, reading: BoatReading) -> Mapping[str, float]:
        """The outputs that ask for a heading in the field, rad, and a speed, m/s."""
        raise NotImplementedError


class HelmGate(Gate):
    """Between the helm and the PID: headings, deg true, and speeds, m/s; the helm puts ``prefix`` before its own."""

    outputs = ("DESIRED_HEADING", "DESIRED_SPEED")

    def __init__(self, frame: FieldFrame, prefix: str = "RAW_") -> None:
        super().__init__(tuple(f"{prefix}{name}" for name in self.outputs))
        self._frame = frame

    def meaning(self, first: float, second: float, reading: BoatReading) -> Nominal:
        """See `Gate`."""
        return Nominal(second, self._frame.heading_to_field_rad(math.radians(first)))

    def encode(self, heading_rad: float, speed_mps: float, reading: BoatReading) -> Mapping[str, float]:
        """DESIRED_HEADING, deg true in [0, 360), and DESIRED_SPEED, m/s."""
        heading_deg = math.degrees(self._frame.heading_to_true_rad(heading_rad) % TWO_PI)
        return dict(zip(self.outputs, (heading_deg, speed_mps), strict=True))


class PidGate(Gate):
    """Between the PID and the actuators: rudder and thrust, percent.

    The shield decides on headings and speeds: what the PID does now is read as the heading and speed that this
    platform's own autopilot would need to do it. A command the shield leaves alone passes as the PID posted it, bit for
    bit; any other is turned into rudder and thrust by the platform's autopilot, which remembers what it saw.

    Args:
        platform: of the boat.
        dt_s: between two commands, s.

    Raises:
        ConfigError: the platform has no rudder and thrust.
    """

    outputs = ("DESIRED_RUDDER", "DESIRED_THRUST")
    at_rest = MappingProxyType(dict.fromkeys(outputs, 0.0))

    def __init__(self, platform: Platform, dt_s: float) -> None:
        super().__init__(tuple(f"{name}{SUFFIX}" for name in self.outputs))
        self.autopilot, self._platform, self._dt_s = Autopilot(platform, dt_s), platform, dt_s
        self._meant: tuple[Nominal, tuple[float, float]] | None = None

    def forget(self) -> None:
        """The connection was lost: there is no nominal command, and the autopilot remembers nothing."""
        super().forget()
        self.autopilot.forget()
        self._meant = None

    def nominal(self, reading: BoatReading) -> Nominal:
        """The heading and speed that the PID's rudder and thrust amount to; a stop when it has been silent."""
        self._meant = None
        return super().nominal(reading)

    def meaning(self, first: float, second: float, reading: BoatReading) -> Nominal:
        """See `Gate`."""
        platform, table = self._platform, np.asarray(self._platform.thrust_map, dtype=float)
        lowest, highest = max(table[0, 0], -platform.max_thrust), min(table[-1, 0], platform.max_thrust)
        rudder = min(max(first, -platform.max_rudder), platform.max_rudder)
        thrust = min(max(second, float(lowest)), float(highest))  # beyond it the speed below would not be its own
        speed_mps = float(np.interp(thrust, table[:, 0], table[:, 1]))  # that this thrust holds on a straight course
        heading_rad = reading.heading_rad + math.radians(self._error_deg(rudder))
        self._meant = Nominal(speed_mps, heading_rad % TWO_PI), (rudder, thrust)
        return self._meant[0]

    def encode(self, heading_rad: float, speed_mps: float, reading: BoatReading) -> Mapping[str, float]:
        """DESIRED_RUDDER and DESIRED_THRUST."""
        values = self.autopilot.step(
            math.degrees(heading_rad), speed_mps, math.degrees(reading.heading_rad), reading.speed_mps
        )
        if self._meant is not None:
            nominal, posted = self._meant
            off = (heading_rad - nominal.heading_rad + math.pi) % TWO_PI - math.pi
            if abs(off) <= SAME and abs(speed_mps - nominal.speed_mps) <= SAME:
                values = self.autopilot.row[L.RUDDER], self.autopilot.row[L.THRUST] = posted
        return dict(zip(self.outputs, values, strict=True))

    def _error_deg(self, rudder: float) -> float:
        """Heading error, deg, for which the platform's PID would answer with this rudder now."""
        gains, row = self._platform.heading_pid, self.autopilot.row
        before = row[L.HEADING_ERROR]
        known = math.isfinite(before) and gains.kd > 0.0
        kd = gains.kd / self._dt_s if known else 0.0
        error = (rudder - gains.ki * row[L.HEADING_INTEGRAL] + (kd * before if known else 0.0)) / (gains.kp + kd)
        return min(max(float(error), -179.0), 179.0)


class Autopilot:
    """A platform's own autopilot, on headings and speeds that somebody else measured; ``row``: what it remembers.

    Raises:
        ConfigError: the platform is not moved by rudder and thrust.
    """

    def __init__(self, platform: Platform, dt_s: float) -> None:
        self._params, self._dt_s = platform.pack(), dt_s
        if self._params[L.KIND] != L.KIND_USV:
            raise ConfigError(f"platform {platform.name!r} has no rudder and thrust; take gate: helm for its boats")
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.row: Array = fresh_state(0.0, 0.0, 0.0)

    def step(
        self, commanded_deg: float, commanded_mps: float, heading_deg: float, speed_mps: float
    ) -> tuple[float, float]:
        """Rudder and thrust, percent, for a commanded heading and speed; the boat's own count where known."""
        row = self.row
        if math.isfinite(heading_deg) and math.isfinite(speed_mps):
            row[L.HEADING], row[L.SPEED] = (heading_deg + 180.0) % 360.0 - 180.0, abs(speed_mps)
        step_boat(
            self._params, row, commanded_mps, (commanded_deg - row[L.HEADING] + 180.0) % 360.0 - 180.0, self._dt_s
        )
        return float(row[L.RUDDER]), float(row[L.THRUST])
