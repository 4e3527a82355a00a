"""`PidGate`: between the PID and the actuators, for those who want to compare with a filter that sits there.

It reads DESIRED_RUDDER_PRECBF and DESIRED_THRUST_PRECBF, where a PID of the community is made to write, and posts the
plain names. The shield decides on headings and speeds: what the PID does now is read as the heading and speed that this
platform's own autopilot would need to do it. A command the shield leaves alone passes as the PID posted it, bit for
bit; any other is turned into rudder and thrust by the platform's autopilot, which remembers what it saw.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ...exceptions import ConfigError
from ...platforms import Platform, fresh_state, step_boat
from ...platforms import layout as L
from ..frame import TWO_PI
from ..messages import BoatReading
from .helm_gate import Inputs, Nominal, standstill
from .wire import Message

SUFFIX = "_PRECBF"
SAME_RAD, SAME_MPS = 1e-9, 1e-9
"""A command this near to what the PID meant is the PID's: what is left is the rounding of angles."""


def check_actuated(platform: Platform) -> None:
    """Check that a boat is moved by rudder and thrust.

    Raises:
        ConfigError: it is not.
    """
    if platform.pack()[L.KIND] != L.KIND_USV:
        raise ConfigError(f"platform {platform.name!r} has no rudder and thrust; take gate: helm for its boats")


class PidGate:
    """See the module.

    Args:
        platform: of the boat.
        dt_s: between two commands, s.

    Raises:
        ConfigError: the platform has no rudder and thrust.
    """

    outputs: tuple[str, ...] = ("DESIRED_RUDDER", "DESIRED_THRUST")
    at_rest: Mapping[str, float] = MappingProxyType(dict.fromkeys(outputs, 0.0))

    def __init__(self, platform: Platform, dt_s: float) -> None:
        check_actuated(platform)
        self.inputs: tuple[str, ...] = tuple(f"{name}{SUFFIX}" for name in self.outputs)
        self._inputs = Inputs(self.inputs)
        self._platform, self._params, self._dt_s = platform, platform.pack(), dt_s
        self.forget()

    def hear(self, message: Message, now_s: float) -> None:
        """Take mail of an input in."""
        self._inputs.hear(message, now_s)

    def forget(self) -> None:
        """The connection was lost: nothing is wanted, and the autopilot remembers nothing."""
        self._inputs.forget()
        self._row = fresh_state(0.0, 0.0, 0.0)
        self._meant: tuple[Nominal, tuple[float, float]] | None = None

    def nominal(self, reading: BoatReading) -> Nominal:
        """The heading and speed that the PID's rudder and thrust amount to; a stop when it has been silent."""
        self._meant = None
        if fault := self._inputs.silent(reading.read_s):
            return standstill(reading, fault)
        rudder, thrust = (self._inputs.value(name) for name in self.inputs)
        heading_rad = reading.heading_rad + math.radians(self._error_deg(rudder))
        nominal = Nominal(self._speed_mps(thrust), heading_rad % TWO_PI)
        self._meant = nominal, (rudder, thrust)
        return nominal

    def encode(self, heading_rad: float, speed_mps: float, reading: BoatReading) -> Mapping[str, float]:
        """DESIRED_RUDDER and DESIRED_THRUST, both in percent."""
        row = self._row
        if math.isfinite(reading.heading_rad) and math.isfinite(reading.speed_mps):
            row[L.HEADING] = (math.degrees(reading.heading_rad) + 180.0) % 360.0 - 180.0
            row[L.SPEED] = abs(reading.speed_mps)
        error_deg = (math.degrees(heading_rad) - row[L.HEADING] + 180.0) % 360.0 - 180.0
        step_boat(self._params, row, speed_mps, error_deg, self._dt_s)
        values = (float(row[L.RUDDER]), float(row[L.THRUST]))
        if self._meant is not None and self._is_meant(heading_rad, speed_mps, self._meant[0]):
            values = self._meant[1]
            row[L.RUDDER], row[L.THRUST] = values
        return dict(zip(self.outputs, values, strict=True))

    @staticmethod
    def _is_meant(heading_rad: float, speed_mps: float, nominal: Nominal) -> bool:
        off = (heading_rad - nominal.heading_rad + math.pi) % TWO_PI - math.pi
        return abs(off) <= SAME_RAD and abs(speed_mps - nominal.speed_mps) <= SAME_MPS

    def _error_deg(self, rudder: float) -> float:
        """Heading error, deg, for which the platform's PID would answer with this rudder now."""
        gains, row = self._platform.heading_pid, self._row
        before = row[L.HEADING_ERROR]
        known = math.isfinite(before) and gains.kd > 0.0
        kd = gains.kd / self._dt_s if known else 0.0
        error = (rudder - gains.ki * row[L.HEADING_INTEGRAL] + (kd * before if known else 0.0)) / (gains.kp + kd)
        return min(max(float(error), -179.0), 179.0)

    def _speed_mps(self, thrust: float) -> float:
        """Speed, m/s, that this thrust holds on a straight course."""
        table = np.asarray(self._platform.thrust_map, dtype=float)
        return float(np.interp(thrust, table[:, 0], table[:, 1]))
