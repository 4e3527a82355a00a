"""A boat's outgoing messages, built from what its sensors say."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame

from .sensing import Snapshot
from .vehicle import Vehicle

_ALTITUDE_MM = 0
_ESTIMATE_FLAGS = 831
"""EKF_STATUS_REPORT: attitude, velocity and position are good."""
_UNIX_2024_US = 1_704_067_200_000_000


@dataclass
class Telemetry:
    """Builds the messages of one boat.

    Attributes:
        vehicle: whose state they tell.
        frame: where the field is.
        origin: the boat's own origin of LOCAL_POSITION_NED: latitude, longitude deg and its place in the field, m; set
            when the position is first known after power on, so that it differs from boat to boat.
    """

    vehicle: Vehicle
    frame: FieldFrame
    origin: tuple[float, float, float, float] | None = None

    def build(self, message: int, snapshot: Snapshot, now_s: float) -> Any | None:
        """The message, or None while the boat cannot know what it would say."""
        return _BUILDERS[message](self, snapshot, now_s)

    def _boot_ms(self, time_s: float) -> int:
        return max(0, round(self.vehicle.uptime_s(time_s) * 1000.0)) & 0xFFFFFFFF

    def _earth(self, snapshot: Snapshot) -> tuple[float, float]:
        """Velocity north and east, m/s."""
        east, north = self.frame.turn_to_earth(*snapshot.velocity_mps)
        return north, east

    def _true_rad(self, snapshot: Snapshot) -> float:
        return self.frame.heading_to_true_rad(snapshot.heading_rad)

    def _heartbeat(self, snapshot: Snapshot, now_s: float) -> Any:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.vehicle.armed else 0
        if self.vehicle.mode.name == "GUIDED":
            base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        status = mavlink.MAV_STATE_ACTIVE if self.vehicle.armed else mavlink.MAV_STATE_STANDBY
        if not self.vehicle.has_attitude(now_s):
            status = mavlink.MAV_STATE_CALIBRATING
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, base, int(self.vehicle.mode), status, 3
        )

    def _global_position(self, snapshot: Snapshot, now_s: float) -> Any:
        latitude = longitude = 0  # what a boat without a position says
        if self.vehicle.has_position(now_s):
            latitude, longitude = round(snapshot.latitude_deg * 1e7), round(snapshot.longitude_deg * 1e7)
        north, east = self._earth(snapshot)
        heading = round(math.degrees(self._true_rad(snapshot)) * 100.0) % 36000
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms(snapshot.time_s),
            latitude,
            longitude,
            _ALTITUDE_MM,
            _ALTITUDE_MM,
            _int16(north * 100.0),
            _int16(east * 100.0),
            0,
            heading,
        )

    def _attitude(self, snapshot: Snapshot, now_s: float) -> Any:
        yaw = (self._true_rad(snapshot) + math.pi) % (2.0 * math.pi) - math.pi
        if not self.vehicle.has_attitude(now_s):
            yaw = math.pi * math.sin(37.0 * now_s)  # still looking for it
        return mavlink.MAVLink_attitude_message(
            self._boot_ms(snapshot.time_s), 0.0, 0.0, yaw, 0.0, 0.0, snapshot.turn_rate_rads
        )

    def _local_position(self, snapshot: Snapshot, now_s: float) -> Any | None:
        if not self.vehicle.has_position(now_s):
            return None
        _, _, x, y = self._own_origin(snapshot)
        east, north = self.frame.turn_to_earth(snapshot.x_m - x, snapshot.y_m - y)
        v_north, v_east = self._earth(snapshot)
        return mavlink.MAVLink_local_position_ned_message(
            self._boot_ms(snapshot.time_s), north, east, 0.0, v_north, v_east, 0.0
        )

    def _own_origin(self, snapshot: Snapshot) -> tuple[float, float, float, float]:
        if self.origin is None:
            self.origin = (snapshot.latitude_deg, snapshot.longitude_deg, snapshot.x_m, snapshot.y_m)
        return self.origin

    def _gps_origin(self, snapshot: Snapshot, now_s: float) -> Any | None:
        if not self.vehicle.has_position(now_s):
            return None
        latitude, longitude, _, _ = self._own_origin(snapshot)
        return mavlink.MAVLink_gps_global_origin_message(
            round(latitude * 1e7), round(longitude * 1e7), _ALTITUDE_MM, round(now_s * 1e6)
        )

    def _gps_raw(self, snapshot: Snapshot, now_s: float) -> Any:
        fix = 6 if self.vehicle.has_position(now_s) and snapshot.has_fix else 1
        north, east = self._earth(snapshot)
        course = round(math.degrees(math.atan2(east, north)) * 100.0) % 36000
        return mavlink.MAVLink_gps_raw_int_message(
            round(snapshot.time_s * 1e6), fix, round(snapshot.latitude_deg * 1e7), round(snapshot.longitude_deg * 1e7),
            _ALTITUDE_MM, 80, 120, round(math.hypot(north, east) * 100.0), course, 14 if fix == 6 else 0,
        )  # fmt: skip

    def _vfr_hud(self, snapshot: Snapshot, now_s: float) -> Any:
        heading = round(math.degrees(self._true_rad(snapshot))) % 360
        speed = math.hypot(*snapshot.velocity_mps)
        return mavlink.MAVLink_vfr_hud_message(speed, speed, heading, 0, 0.0, 0.0)

    def _system_time(self, snapshot: Snapshot, now_s: float) -> Any:
        return mavlink.MAVLink_system_time_message(_UNIX_2024_US + round(now_s * 1e6), self._boot_ms(now_s))

    def _sys_status(self, snapshot: Snapshot, now_s: float) -> Any:
        return mavlink.MAVLink_sys_status_message(0, 0, 0, 100, 12_600, 500, 90, 0, 0, 0, 0, 0, 0)

    def _estimate(self, snapshot: Snapshot, now_s: float) -> Any:
        flags = _ESTIMATE_FLAGS if self.vehicle.has_position(now_s) else mavlink.EKF_ATTITUDE
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.05, 0.05, 0.05, 0.05, 0.0)

    def _version(self, snapshot: Snapshot, now_s: float) -> Any:
        major, minor, patch = self.vehicle.settings.firmware.version
        can = (
            mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        )
        none = [0] * 8
        version = major << 24 | minor << 16 | patch << 8
        return mavlink.MAVLink_autopilot_version_message(can, version, 0, 0, 0, none, none, none, 0, 0, 0)


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))


_BUILDERS: dict[int, Callable[[Telemetry, Snapshot, float], Any | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Telemetry._heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: Telemetry._sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: Telemetry._system_time,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: Telemetry._gps_raw,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: Telemetry._attitude,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Telemetry._local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Telemetry._global_position,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: Telemetry._gps_origin,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: Telemetry._vfr_hud,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: Telemetry._estimate,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: Telemetry._version,
}

CAN_SEND = frozenset(_BUILDERS)
"""Ids of the messages a boat can send at intervals or on request."""
