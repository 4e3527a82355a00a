"""A boat's outgoing messages, built from what its sensors say."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame

from .sensing import Snapshot
from .vehicle import Mode, Vehicle

_ESTIMATE_FLAGS = 831
"""EKF_STATUS_REPORT: attitude, velocity and position are good."""
_VERSION = 4 << 24 | 6 << 16
"""4.6.0, the one that was measured."""
_UNIX_2024_US = 1_704_067_200_000_000
_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


@dataclass
class Telemetry:
    """Builds the messages of one boat: a method each, named as its message.

    ``origin``: where the position was first known after power on, its own origin of LOCAL_POSITION_NED, so that it
    differs from boat to boat.
    """

    vehicle: Vehicle
    frame: FieldFrame
    origin: Snapshot | None = None

    def build(self, number: int, seen: Snapshot, now_s: float) -> Any | None:
        """The message of that number, or None while the boat cannot know what it would say."""
        self._seen, self._now_s, self._placed = seen, now_s, self.vehicle.has_position(now_s)
        self._east, self._north = self.frame.turn_to_earth(*seen.velocity_mps)
        self._yaw_rad = self.frame.heading_to_true_rad(seen.heading_rad)
        self._boot_ms = self._since_boot_ms(seen.time_s)
        if self._placed and self.origin is None:
            self.origin = seen
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

    def _local_position_ned(self) -> Any | None:
        if not self._placed or self.origin is None:
            return None
        east, north = self.frame.turn_to_earth(self._seen.x_m - self.origin.x_m, self._seen.y_m - self.origin.y_m)
        return mavlink.MAVLink_local_position_ned_message(self._boot_ms, north, east, 0.0, self._north, self._east, 0.0)

    def _gps_global_origin(self) -> Any | None:
        if not self._placed or self.origin is None:
            return None
        place = (round(self.origin.latitude_deg * 1e7), round(self.origin.longitude_deg * 1e7))
        return mavlink.MAVLink_gps_global_origin_message(*place, 0, round(self._now_s * 1e6))

    def _gps_raw_int(self) -> Any:
        seen, fix = self._seen, 6 if self._placed and self._seen.has_fix else 1
        place = (round(seen.latitude_deg * 1e7), round(seen.longitude_deg * 1e7))
        course = round(math.degrees(math.atan2(self._east, self._north)) * 100.0) % 36000
        speed, satellites = round(math.hypot(self._north, self._east) * 100.0), 14 if fix == 6 else 0
        return mavlink.MAVLink_gps_raw_int_message(
            round(seen.time_s * 1e6), fix, *place, 0, 80, 120, speed, course, satellites
        )

    def _vfr_hud(self) -> Any:
        speed = math.hypot(*self._seen.velocity_mps)
        heading = round(math.degrees(self._yaw_rad)) % 360
        return mavlink.MAVLink_vfr_hud_message(speed, speed, heading, 0, 0.0, 0.0)

    def _system_time(self) -> Any:
        unix_us = _UNIX_2024_US + round(self._now_s * 1e6)
        return mavlink.MAVLink_system_time_message(unix_us, self._since_boot_ms(self._now_s))

    def _sys_status(self) -> Any:
        return mavlink.MAVLink_sys_status_message(0, 0, 0, 100, 12_600, 500, 90, 0, 0, 0, 0, 0, 0)

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
