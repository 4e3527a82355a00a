"""`Platform`: a boat and its autopilot's settings, validated when built."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..exceptions import PlatformError
from . import layout as L
from .proving import fault_of

KINDS = {
    "usv": L.KIND_USV,
    "single_integrator": L.KIND_SINGLE_INTEGRATOR,
    "double_integrator": L.KIND_DOUBLE_INTEGRATOR,
    "rate": L.KIND_RATE,
}


def _check_number(who: str, name: str, value: object, low: float = 0.0) -> None:
    """Raise unless the value is a finite number >= ``low``."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise PlatformError(f"{who}: {name} is {value!r}; give a number")
    if not math.isfinite(value):
        raise PlatformError(f"{who}: {name} is {value}; give a finite number")
    if value < low:
        raise PlatformError(f"{who}: {name} is {value}; it must be >= {low:g}")


@dataclass(frozen=True)
class Gains:
    """Gains of one PID controller: output = p + i + d on the error; the integral is clamped.

    Raises:
        PlatformError: a gain is not a finite number >= 0.
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    integral_limit: float = 0.0

    def __post_init__(self) -> None:
        for entry in fields(self):
            _check_number("controller", entry.name, getattr(self, entry.name))


@dataclass(frozen=True)
class Platform:
    """A boat behind its autopilot.

    Units: speeds m/s, accelerations m/s^2, turn rates deg/s, thrust and rudder in percent. For
    ``kind="usv"`` the heading change per step is ``rudder * turn_gain/100 * dt * thrust/50`` deg and the
    steady speed is ``thrust_map(thrust) * (1 - |rudder|/100 * turn_loss)``; a limit of 0 on acceleration or
    deceleration means none. Integrators use ``max_turn_rate_dps``, ``max_acc`` and ``max_angular_acc_dps2``.
    ``kind="rate"`` turns by a rate loop, see `rate`: besides those it uses ``max_dec`` (0: as ``max_acc``),
    ``turn_rate_at_rest_dps``, ``turn_rate_per_mps``, ``turn_lag_s``, ``speed_lag_s``, ``turn_loss`` and, of its
    ``heading_pid``, ``kp`` in 1/s. `schema` has a word on each.

    When it is built it is run in its own model, once: it must come to its top speed, turn and stop.

    Raises:
        PlatformError: a value is missing, non-finite or out of range, the kind is unknown, or the boat cannot move,
            turn or stop.
    """

    name: str
    kind: str
    max_speed_mps: float
    thrust_map: tuple[tuple[float, float], ...] = ((0.0, 0.0), (100.0, 1.0))
    speed_factor: float = 0.0
    max_thrust: float = 100.0
    max_rudder: float = 100.0
    turn_loss: float = 0.0
    turn_gain: float = 0.0
    max_acc: float = 0.0
    max_dec: float = 0.0
    rotate_speed_dps: float = 0.0
    speed_gain: float = 1.0
    speed_pid: Gains = field(default_factory=Gains)
    heading_pid: Gains = field(default_factory=Gains)
    max_turn_rate_dps: float = 0.0
    max_angular_acc_dps2: float = 0.0
    turn_rate_at_rest_dps: float = 0.0
    turn_rate_per_mps: float = 0.0
    turn_lag_s: float = 0.0
    speed_lag_s: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise PlatformError(f"a platform's name is {self.name!r}; give it one")
        if not isinstance(self.kind, str) or self.kind not in KINDS:
            raise PlatformError(f"platform {self.name!r}: unknown kind {self.kind!r}; choose one of {sorted(KINDS)}")
        who = f"platform {self.name!r}"
        for entry in fields(self):
            if entry.name not in ("name", "kind", "thrust_map", "speed_pid", "heading_pid"):
                low = -math.inf if entry.name in ("rotate_speed_dps", "turn_rate_per_mps") else 0.0
                _check_number(who, entry.name, getattr(self, entry.name), low)
        if self.max_speed_mps == 0:
            raise PlatformError(f"{who}: max_speed_mps is {self.max_speed_mps}; it must be > 0")
        if self.turn_loss > 1:
            raise PlatformError(f"{who}: turn_loss is {self.turn_loss}; it is the share of speed lost, 0 to 1")
        for name in ("speed_pid", "heading_pid"):
            if not isinstance(getattr(self, name), Gains):
                raise PlatformError(f"{who}: {name} is {getattr(self, name)!r}; give Gains(kp=..., ki=..., kd=...)")
        try:
            points = tuple(tuple(point) for point in self.thrust_map)
        except TypeError:
            raise PlatformError(f"{who}: thrust_map is {self.thrust_map!r}; give (thrust, speed) points") from None
        object.__setattr__(self, "thrust_map", points)
        self._check_thrust_map()
        self._check_rate()
        fault = fault_of(self)
        if fault is not None:
            raise PlatformError(f"{who} is no boat that can be steered: in its own model, {fault}")

    def _check_thrust_map(self) -> None:
        for point in self.thrust_map:
            if len(point) != 2:
                raise PlatformError(f"platform {self.name!r}: thrust_map holds {point}; give (thrust, speed) points")
            for value in point:
                _check_number(f"platform {self.name!r}", "thrust_map", value, -math.inf)
        thrusts = [point[0] for point in self.thrust_map]
        if not 2 <= len(thrusts) <= L.MAP_CAPACITY or any(b <= a for a, b in pairwise(thrusts)):
            raise PlatformError(
                f"platform {self.name!r}: thrust_map needs 2 to {L.MAP_CAPACITY} (thrust, speed) points "
                f"with rising thrust, got {self.thrust_map}"
            )

    def _check_rate(self) -> None:
        who = f"platform {self.name!r}"
        if self.kind == "rate":
            for name in ("max_acc", "max_turn_rate_dps", "max_angular_acc_dps2"):
                if getattr(self, name) == 0:
                    raise PlatformError(f"{who}: {name} is 0; a boat of kind 'rate' needs one above 0")
            if self.heading_pid.kp == 0:
                raise PlatformError(f"{who}: heading_pid.kp is 0; give deg/s asked for per deg of heading error")
            return
        for name in ("turn_rate_at_rest_dps", "turn_rate_per_mps", "turn_lag_s", "speed_lag_s"):
            if getattr(self, name) != 0:
                raise PlatformError(f"{who}: {name} is for boats of kind 'rate', this is a {self.kind!r}; leave it out")

    def pack(self) -> NDArray[np.float64]:
        """Parameter row for compiled code, shape ``(N_PARAM,)``, laid out as in `layout`."""
        row = np.zeros(L.N_PARAM)
        row[L.KIND] = KINDS[self.kind]
        row[L.MAX_SPEED : L.ROTATE_SPEED + 1] = (
            self.max_speed_mps,
            self.speed_factor,
            self.max_thrust,
            self.max_rudder,
            self.turn_loss,
            self.turn_gain,
            self.max_acc,
            self.max_dec,
            self.rotate_speed_dps,
        )
        speed, heading = self.speed_pid, self.heading_pid
        row[L.SPEED_KP : L.SPEED_GAIN + 1] = speed.kp, speed.ki, speed.kd, speed.integral_limit, self.speed_gain
        row[L.HEADING_KP : L.HEADING_LIMIT + 1] = heading.kp, heading.ki, heading.kd, heading.integral_limit
        row[L.MAX_TURN_RATE] = self.max_turn_rate_dps
        row[L.MAX_ANGULAR_ACC] = self.max_angular_acc_dps2
        if self.kind == "rate":
            row[L.MAX_DEC] = self.max_dec or self.max_acc
            row[L.TURN_AT_REST], row[L.TURN_PER_SPEED] = self.turn_rate_at_rest_dps, self.turn_rate_per_mps
            row[L.TURN_LAG], row[L.SPEED_LAG] = self.turn_lag_s, self.speed_lag_s
        row[L.MAP_SIZE] = len(self.thrust_map)
        for i, (thrust, speed_mps) in enumerate(self.thrust_map):
            row[L.MAP_THRUST + i] = thrust
            row[L.MAP_SPEED + i] = speed_mps
        return row

    def fastest_mps(self, dt_s: float) -> float:
        """Highest speed over ground, m/s, in a step of ``dt_s``.

        A thrust boat moves with the mean of old and new speed, of which only the stored one is cut to top speed.
        """
        if self.kind != "usv":
            return self.max_speed_mps
        thrusts, speeds = np.asarray(self.thrust_map).T
        reached = [self.max_thrust, *(thrust for thrust in thrusts if 0.0 <= thrust <= self.max_thrust)]
        new = float(np.interp(reached, thrusts, speeds).max())
        if self.max_acc > 0.0:
            new = min(new, self.max_speed_mps + self.max_acc * dt_s)
        return max(self.max_speed_mps, 0.5 * (self.max_speed_mps + new))

    def max_turn_rate_at(self, speed_mps: float) -> float:
        """Highest steady turn rate, deg/s, at a straight-line speed (m/s): full rudder at that speed's thrust."""
        if self.kind == "rate":
            free = self.turn_rate_at_rest_dps + self.turn_rate_per_mps * speed_mps
            return min(max(free, 0.0), self.max_turn_rate_dps)
        if self.kind != "usv":
            return self.max_turn_rate_dps
        thrusts, speeds = np.asarray(self.thrust_map).T
        thrust = min(float(np.interp(speed_mps, speeds, thrusts)), self.max_thrust)
        rudder = min(self.max_rudder, 100.0)
        return rudder * self.turn_gain / 100.0 * thrust / 50.0
