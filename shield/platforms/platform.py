"""`Platform`: a boat and its autopilot's settings, validated when built."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field, fields
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


ALL = ("usv", "rate", "double_integrator", "single_integrator")
USV, RATE, BOATS, LIMITED = ALL[:1], ALL[1:2], ALL[:2], ALL[1:3]


@dataclass(frozen=True)
class Entry:
    """An entry of a platform, and its explanation in platform files."""

    unit: str  # of its value; empty: none
    words: str  # what it is
    kinds: tuple[str, ...] = ALL  # kinds of boats that have it
    column: int = -1  # first column in the parameter row


ENTRIES: dict[str, Entry] = {
    "max_speed_mps": Entry("m/s", "top speed", ALL, L.MAX_SPEED),
    "max_acc": Entry("m/s2", "limit on gaining speed; of kind usv 0 is none", (*USV, *LIMITED), L.MAX_ACC),
    "max_dec": Entry("m/s2", "limit on losing speed; 0: of kind rate as max_acc, of kind usv none", BOATS, L.MAX_DEC),
    "speed_lag_s": Entry("s", "lag of the speed behind its command", RATE, L.SPEED_LAG),
    "max_turn_rate_dps": Entry("deg/s", "highest turn rate at any speed", ALL[1:], L.MAX_TURN_RATE),
    "max_angular_acc_dps2": Entry("deg/s2", "limit on changing the turn rate", LIMITED, L.MAX_ANGULAR_ACC),
    "turn_rate_at_rest_dps": Entry(
        "deg/s", "highest turn rate without way; 0: it has to go to steer", RATE, L.TURN_AT_REST
    ),
    "turn_rate_per_mps": Entry(
        "deg/s per m/s", "turn rate gained with speed; below 0: two propellers lose it", RATE, L.TURN_PER_SPEED
    ),
    "turn_lag_s": Entry("s", "lag of the turn rate behind its command", RATE, L.TURN_LAG),
    "turn_loss": Entry(
        "share", "of speed lost at full rudder, or at the highest turn rate; 0 to 1", BOATS, L.TURN_LOSS
    ),
    "heading_pid": Entry(
        "", "heading controller: rudder percent per deg (usv), deg/s per deg (rate: kp alone)", BOATS, L.HEADING_KP
    ),
    "thrust_map": Entry("percent, m/s", "(thrust, steady speed) points, thrust rising", USV, L.MAP_THRUST),
    "speed_factor": Entry(
        "percent per m/s", "thrust per commanded speed; 0: speed_pid changes the thrust", USV, L.SPEED_FACTOR
    ),
    "max_thrust": Entry("percent", "largest thrust", USV, L.MAX_THRUST),
    "max_rudder": Entry("percent", "largest rudder", USV, L.MAX_RUDDER),
    "turn_gain": Entry("deg/s", "turn rate at full rudder and thrust 50; twice that at thrust 100", USV, L.TURN_GAIN),
    "full_turn_speed_mps": Entry(
        "m/s", "speed for that turn rate, in proportion below; 0: at any speed", USV, L.FULL_TURN_SPEED
    ),
    "rotate_speed_dps": Entry("deg/s", "turn rate that is always there", USV, L.ROTATE_SPEED),
    "speed_gain": Entry("percent per output", "of speed_pid, added to the thrust in each step", USV, L.SPEED_GAIN),
    "speed_pid": Entry("", "speed controller: output per m/s", USV, L.SPEED_KP),
}
"""Entries of a boat besides its name and kind, in the order of files."""


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
    """Gains of a PID controller: output = p + i + d on the error; the integral is clamped.

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

    Units: speeds m/s, accelerations m/s^2, turn rates deg/s, thrust and rudder in percent. `ENTRIES` explains each
    setting.

    For ``kind="usv"`` the heading change per step is ``rudder * turn_gain/100 * dt * thrust/50`` deg. Below
    ``full_turn_speed_mps`` it shrinks in proportion to speed. The steady speed is ``thrust_map(thrust) * (1 -
    |rudder|/100 * turn_loss)``. A limit of 0 on acceleration or deceleration means none.

    Integrators use ``max_turn_rate_dps``, ``max_acc`` and ``max_angular_acc_dps2``. ``kind="rate"`` turns by a rate
    loop, see `rate`. It also uses ``max_dec`` (0: as ``max_acc``), ``turn_rate_at_rest_dps``, ``turn_rate_per_mps``,
    ``turn_lag_s``, ``speed_lag_s``, ``turn_loss`` and, of ``heading_pid``, ``kp`` in 1/s.

    A new platform is simulated once in its own model: it must reach its top speed, turn and stop.

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
    full_turn_speed_mps: float = 0.0
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
        for name in ENTRIES:
            if name not in ("thrust_map", "speed_pid", "heading_pid"):
                low = -math.inf if name in ("rotate_speed_dps", "turn_rate_per_mps") else 0.0
                _check_number(who, name, getattr(self, name), low)
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
        self._check_thrust_map(who)
        self._check_rate(who)
        fault = fault_of(self)
        if fault is not None:
            raise PlatformError(f"{who} is no boat that can be steered: in its own model, {fault}")

    def _check_thrust_map(self, who: str) -> None:
        for point in self.thrust_map:
            if len(point) != 2:
                raise PlatformError(f"{who}: thrust_map holds {point}; give (thrust, speed) points")
            for value in point:
                _check_number(who, "thrust_map", value, -math.inf)
        thrusts = [point[0] for point in self.thrust_map]
        if not 2 <= len(thrusts) <= L.MAP_CAPACITY or any(b <= a for a, b in pairwise(thrusts)):
            raise PlatformError(
                f"{who}: thrust_map needs 2 to {L.MAP_CAPACITY} (thrust, speed) points with rising thrust, got "
                f"{self.thrust_map}"
            )

    def _check_rate(self, who: str) -> None:
        if self.kind == "rate":
            for name in ("max_acc", "max_turn_rate_dps", "max_angular_acc_dps2"):
                if getattr(self, name) == 0:
                    raise PlatformError(f"{who}: {name} is 0; a boat of kind 'rate' needs one above 0")
            if self.heading_pid.kp == 0:
                raise PlatformError(f"{who}: heading_pid.kp is 0; give deg/s commanded per deg of heading error")
        for name, entry in ENTRIES.items():
            alone = entry.kinds == RATE or name == "full_turn_speed_mps"
            if alone and self.kind not in entry.kinds and getattr(self, name) != 0:
                kind = entry.kinds[0]
                raise PlatformError(
                    f"{who}: {name} is for boats of kind {kind!r}, this is a {self.kind!r}; leave it out"
                )

    def pack(self) -> NDArray[np.float64]:
        """Return the parameter row for compiled code, shape ``(N_PARAM,)``, laid out as in `layout`."""
        row = np.zeros(L.N_PARAM)
        row[L.KIND] = KINDS[self.kind]
        entries = [(name, entry) for name, entry in ENTRIES.items() if name != "thrust_map"]
        # kinds use some columns for values of their own: what is for this kind alone is written last
        entries.sort(key=lambda item: (self.kind in item[1].kinds, -len(item[1].kinds)))
        for name, entry in entries:
            value, column = getattr(self, name), entry.column
            values = astuple(value) if isinstance(value, Gains) else (value,)
            row[column : column + len(values)] = values
        if self.kind == "rate":
            row[L.MAX_DEC] = self.max_dec or self.max_acc
        row[L.MAP_SIZE] = len(self.thrust_map)
        for i, (thrust, speed_mps) in enumerate(self.thrust_map):
            row[L.MAP_THRUST + i] = thrust
            row[L.MAP_SPEED + i] = speed_mps
        return row

    def fastest_mps(self, dt_s: float) -> float:
        """Return the highest speed over ground, m/s, in a step of ``dt_s``.

        A thrust boat moves with the mean of old and new speed; only the stored speed is limited to top speed.
        """
        return max(self.max_speed_mps, 0.5 * (self.max_speed_mps + self.newest_mps(dt_s)))

    def newest_mps(self, dt_s: float) -> float:
        """Return the highest speed at the end of a step of ``dt_s``, before the mean with the old one, m/s."""
        if self.kind != "usv":
            return self.max_speed_mps
        thrusts, speeds = np.asarray(self.thrust_map).T
        reached = [self.max_thrust, *(thrust for thrust in thrusts if 0.0 <= thrust <= self.max_thrust)]
        new = float(np.interp(reached, thrusts, speeds).max())
        if self.max_acc > 0.0:
            new = min(new, self.max_speed_mps + self.max_acc * dt_s)
        return new

    def max_turn_rate_at(self, speed_mps: float) -> float:
        """Return the highest steady turn rate, deg/s, at a straight-line speed, m/s.

        For a thrust boat this is at full rudder and that speed's thrust.
        """
        if self.kind == "rate":
            free = self.turn_rate_at_rest_dps + self.turn_rate_per_mps * speed_mps
            return min(max(free, 0.0), self.max_turn_rate_dps)
        if self.kind != "usv":
            return self.max_turn_rate_dps
        thrusts, speeds = np.asarray(self.thrust_map).T
        thrust = min(float(np.interp(speed_mps, speeds, thrusts)), self.max_thrust)
        rudder = min(self.max_rudder, 100.0)
        return rudder * self.turn_gain / 100.0 * thrust / 50.0 * self.way_share(speed_mps)

    def way_share(self, speed_mps: float) -> float:
        """Return the share of its full turn that a thrust boat makes at a speed, m/s."""
        full_mps = self.full_turn_speed_mps
        return min(speed_mps / full_mps, 1.0) if full_mps > 0.0 else 1.0
