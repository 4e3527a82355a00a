"""The autopilot but for its wire: modes, parameters, arming, time-outs, what it says, and which message how often."""

from __future__ import annotations

import difflib
import math
import time
from collections import deque
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError

from .hull import STEP_S, Coast, Keep, Order, Steer, Turn
from .sensing import Snapshot
from .settings import AutopilotSettings

_ESTIMATE_FLAGS = 831  # EKF_STATUS_REPORT: attitude, velocity and position are good
_VERSION = 4 << 24 | 6 << 16  # 4.6.0, the one that was measured
_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


@dataclass
class Telemetry:
    """Builds the messages of one boat: a method each, named as its message."""

    vehicle: Vehicle
    frame: FieldFrame

    def build(self, number: int, seen: Snapshot, now_s: float) -> Any:
        """The message of that number."""
        self._seen, self._now_s, self._placed = seen, now_s, self.vehicle.has_position(now_s)
        self._east, self._north = self.frame.turn_to_earth(*seen.velocity_mps)
        self._yaw_rad = self.frame.heading_to_true_rad(seen.heading_rad)
        self._boot_ms = self._since_boot_ms(seen.time_s)
        return getattr(self, CAN_SEND[number])()

    def _since_boot_ms(self, time_s: float) -> int:
        return max(0, round((time_s - self.vehicle.booted_s) * 1e3)) & 0xFFFFFFFF

    def _heartbeat(self) -> Any:
        vehicle, base = self.vehicle, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if vehicle.armed else 0
        if vehicle.mode is Mode.GUIDED:
            base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        status = mavlink.MAV_STATE_ACTIVE if vehicle.armed else mavlink.MAV_STATE_STANDBY
        status = status if vehicle.has_attitude(self._now_s) else mavlink.MAV_STATE_CALIBRATING
        kind, make = mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return mavlink.MAVLink_heartbeat_message(kind, make, base, int(vehicle.mode), status, 3)

    def _global_position_int(self) -> Any:
        place, seen = (0, 0), self._seen  # what a boat without a position says
        if self._placed:
            place = (round(seen.latitude_deg * 1e7), round(seen.longitude_deg * 1e7))
        velocity = (max(-32768, min(32767, round(100.0 * v))) for v in (self._north, self._east, 0.0))
        heading = round(math.degrees(self._yaw_rad) * 100.0) % 36000
        return mavlink.MAVLink_global_position_int_message(self._boot_ms, *place, 0, 0, *velocity, heading)

    def _attitude(self) -> Any:
        yaw = (self._yaw_rad + math.pi) % (2.0 * math.pi) - math.pi
        if not self.vehicle.has_attitude(self._now_s):
            yaw = math.pi * math.sin(37.0 * self._now_s)  # still looking for it
        return mavlink.MAVLink_attitude_message(self._boot_ms, 0.0, 0.0, yaw, 0.0, 0.0, self._seen.turn_rate_rads)

    def _gps_raw_int(self) -> Any:
        seen, fix = self._seen, 6 if self._placed and self._seen.has_fix else 1
        place = (round(seen.latitude_deg * 1e7), round(seen.longitude_deg * 1e7))
        course = round(math.degrees(math.atan2(self._east, self._north)) * 100.0) % 36000
        speed, satellites = round(math.hypot(self._north, self._east) * 100.0), 14 if fix == 6 else 0
        return mavlink.MAVLink_gps_raw_int_message(
            round(seen.time_s * 1e6), fix, *place, 0, 80, 120, speed, course, satellites
        )

    def _system_time(self) -> Any:
        return mavlink.MAVLink_system_time_message(time.time_ns() // 1000, self._since_boot_ms(self._now_s))

    def _ekf_status_report(self) -> Any:
        flags = _ESTIMATE_FLAGS if self._placed else mavlink.EKF_ATTITUDE
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.05, 0.05, 0.05, 0.05, 0.0)

    def _autopilot_version(self) -> Any:
        none = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(_CAPABILITIES, _VERSION, 0, 0, 0, none, none, none, 0, 0, 0)


CAN_SEND = {
    int(number): f"_{kind.msgname.lower()}"
    for number, kind in mavlink.mavlink_map.items()
    if f"_{kind.msgname.lower()}" in vars(Telemetry)
}
"""Numbers of the messages a boat can send at intervals or on request, and the methods that build them."""


class Mode(IntEnum):
    """Modes by the autopilot's own numbers."""

    MANUAL = 0
    ACRO = 1
    STEERING = 3
    HOLD = 4
    LOITER = 5
    AUTO = 10
    RTL = 11
    SMART_RTL = 12
    GUIDED = 15


NEEDS_POSITION = frozenset({Mode.LOITER, Mode.GUIDED})  # modes that cannot be entered before the position is known
NOT_OFFERED = frozenset({Mode.AUTO, Mode.RTL, Mode.SMART_RTL})
"""Modes that need a mission or a path back, which these boats do not have."""

REAL32, _INT8, _INT16, _INT32 = 9, 2, 4, 6
PARAMETERS: dict[str, tuple[float, int]] = {
    "SYSID_THISMAV": (1.0, _INT16),
    "SYSID_MYGCS": (255.0, _INT16),
    "ARMING_CHECK": (1.0, _INT32),
    "CRUISE_SPEED": (2.0, REAL32),
    "FRAME_CLASS": (2.0, _INT8),
    "AVOID_ENABLE": (3.0, _INT8),
    "FENCE_ACTION": (2.0, _INT8),
    "FENCE_ENABLE": (0.0, _INT8),
    "FS_ACTION": (2.0, _INT8),
    "FS_GCS_ENABLE": (0.0, _INT8),
    "FS_GCS_TIMEOUT": (5.0, REAL32),
    "FS_TIMEOUT": (1.5, REAL32),
    "INITIAL_MODE": (0.0, _INT8),
    "LOIT_RADIUS": (2.0, REAL32),
    "OA_TYPE": (0.0, _INT8),
    "WP_SPEED": (2.0, REAL32),
}
"""Defaults and MAV_PARAM_TYPEs."""

WARNING, CRITICAL, INFO = 4, 2, 6  # severities of texts
NO_ARMING = "Arm: AHRS: not using configured AHRS type"
_POSITION_SHARE, _ATTITUDE_SHARE = 9.0 / 42.0, 1.0 / 42.0  # of the time from power on to arming, as measured


class Vehicle:
    """One boat's autopilot from power on.

    Attributes:
        parameters: values by name; kept over a restart, as on a real boat.
        mode, armed: present ones.
        texts: (severity, text) not yet sent.
        target: what the commander asked for; None when there is none or it timed out.
        ground_s: when a heartbeat of the ground station came last.

    Raises:
        ConfigError: a parameter it does not have.
    """

    def __init__(self, settings: AutopilotSettings) -> None:
        self.settings = settings
        self.parameters = {name: PARAMETERS[name][0] for name in sorted(PARAMETERS)}
        for name, value in settings.parameters.items():
            if name not in self.parameters:
                near = difflib.get_close_matches(name, self.parameters, n=1)
                hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(self.parameters)}"
                raise ConfigError(f"the simulated autopilot has no parameter {name!r}; {hint}")
            self.parameters[name] = float(value)
        self.texts: deque[tuple[int, str]] = deque(maxlen=100)
        self.boot(0.0)

    def boot(self, now_s: float) -> None:
        """Start, or start again: everything but the parameters is forgotten."""
        self.booted_s, self.armed = now_s, False
        self.mode = Mode(int(self.parameters["INITIAL_MODE"]))
        self.target: Steer | Turn | None = None
        self._target_s, self.ground_s, self._timed_out = -math.inf, math.inf, False
        self.texts.clear()
        self.texts.append((INFO, "ArduPilot Ready"))

    def set_parameter(self, name: str, value: float) -> bool:
        """Set a known parameter, integers rounded; False for what cannot be set."""
        if name not in self.parameters or not math.isfinite(value):
            return False
        self.parameters[name] = float(value if PARAMETERS[name][1] == REAL32 else round(value))
        return True

    def has_position(self, now_s: float) -> bool:
        """Whether it knows where it is."""
        return now_s - self.booted_s >= self.settings.boot_s * _POSITION_SHARE

    def has_attitude(self, now_s: float) -> bool:
        """Whether its attitude is to be believed."""
        return now_s - self.booted_s >= self.settings.boot_s * _ATTITUDE_SHARE

    def arm(self, now_s: float, force: bool = False) -> bool:
        """Arm; refusals are explained in a text."""
        skips = force or self.parameters["ARMING_CHECK"] == 0.0
        self.armed = self.armed or skips or now_s - self.booted_s >= self.settings.boot_s
        if not self.armed:
            self.texts.append((CRITICAL, NO_ARMING))
        return self.armed

    def set_mode(self, number: int, now_s: float) -> bool:
        """Change mode; refusals are explained in a text."""
        if number not in list(Mode):
            self.texts.append((WARNING, f"No such mode {number}"))
            return False
        mode = Mode(number)
        if mode == self.mode:
            return True
        if mode in NOT_OFFERED or (mode in NEEDS_POSITION and not self.has_position(now_s)):
            self.texts.append((WARNING, "Flight mode change failed"))
            return False
        self.mode, self.target, self._timed_out = mode, None, False
        return True

    def take(self, target: Steer | Turn, now_s: float) -> bool:
        """Obey a target from now on; in any other mode than GUIDED it is ignored."""
        if self.mode is not Mode.GUIDED:
            return False
        self.target, self._target_s, self._timed_out = target, now_s, False
        return True

    def tick(self, now_s: float) -> None:
        """Look at the clocks: targets that grew old, ground stations gone silent."""
        limit = self.settings.timeout_s
        if self.target is not None and now_s - self._target_s > limit:
            self.texts.append((WARNING, f"target not received last {limit:g}secs, stopping"))
            self.target, self._timed_out = None, True
        patience = self.parameters["FS_GCS_TIMEOUT"] + self.parameters["FS_TIMEOUT"]
        watched = self.parameters["FS_GCS_ENABLE"] != 0.0 and self.armed and self.mode is not Mode.HOLD
        if watched and now_s - self.ground_s > patience:
            self.texts.append((CRITICAL, "Radio Failsafe"))
            self.set_mode(Mode.HOLD, now_s)

    def order(self) -> Order:
        """What the hull is to do now."""
        if not self.armed or self.mode in (Mode.MANUAL, Mode.ACRO, Mode.STEERING, Mode.HOLD):
            return Coast()
        if self.mode is Mode.GUIDED and self.target is not None:
            return self.target
        return Keep(self.settings.back_up_m if self._timed_out else 0.0)


HEARTBEAT, HEARTBEAT_S = mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1.0


class Streams:
    """Intervals of one boat's messages, at first heartbeats only; nothing is sent faster than ``top_rate_hz``."""

    def __init__(self, top_rate_hz: float, known: frozenset[int]) -> None:
        self._shortest_s, self._known = 1.0 / top_rate_hz, known
        self._interval_s = {HEARTBEAT: HEARTBEAT_S}
        self._next_s: dict[int, float] = {}

    def set_interval(self, message: int, interval_us: float) -> bool:
        """SET_MESSAGE_INTERVAL: -1 never, 0 the default; False for a message it cannot send."""
        if message not in self._known:
            return False
        self._interval_s.pop(message, None)
        self._next_s.pop(message, None)
        if interval_us > 0.0:
            self._interval_s[message] = max(interval_us * 1e-6, self._shortest_s)
        elif message == HEARTBEAT:
            self._interval_s[message] = HEARTBEAT_S
        return True

    def due(self, now_s: float) -> list[int]:
        """Messages to send now; one that fell behind is sent once.

        Each begins at a multiple of the hull's step, so that it tells each new state as soon as there is one.
        """
        due = []
        for message, interval in self._interval_s.items():
            at = self._next_s.setdefault(message, math.ceil(now_s / STEP_S - 1e-6) * STEP_S)
            if at <= now_s + 1e-9:
                due.append(message)
                self._next_s[message] = at + interval if at + interval > now_s else now_s + interval
        return due
