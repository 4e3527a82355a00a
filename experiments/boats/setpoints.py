"""What SET_* messages ask for, read as the measured autopilot reads them, traps included; none is acknowledged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame

from .orders import Reach, Steer, Turn
from .sensing import Snapshot

Target = Steer | Turn | Reach

_POSITION, _VELOCITY, _ACCELERATION, _YAW, _YAW_RATE = 7, 56, 448, 1024, 2048
"""Bits of a position target's type mask that tell to ignore a part."""
_ATTITUDE_RATE_IGNORED, _THRUST_IGNORED = 4, 64
_LOCAL, _LOCAL_OFFSET, _BODY, _BODY_OFFSET = 1, 7, 8, 9
_BODY_FRAMES = (_BODY, _BODY_OFFSET)
_GLOBAL_FRAMES = (0, 3, 5, 6, 10, 11)


@dataclass(frozen=True)
class Situation:
    """What a boat needs to know to read a target.

    Attributes:
        frame: where the field is.
        snapshot: its present state.
        top_mps: WP_SPEED.
        yaw_trap: see `Firmware`.
        origin_m: place of its own local origin in the field.
    """

    frame: FieldFrame
    snapshot: Snapshot
    top_mps: float
    yaw_trap: bool
    origin_m: tuple[float, float]

    @property
    def true_rad(self) -> float:
        """Its heading clockwise from true north."""
        return self.frame.heading_to_true_rad(self.snapshot.heading_rad)

    def steer(self, true_rad: float, speed_mps: float) -> Steer:
        """A target of a true heading."""
        return Steer(self.frame.heading_to_field_rad(true_rad), speed_mps)


def attitude_target(message: Any, at: Situation) -> Target | None:
    """SET_ATTITUDE_TARGET; None when it is dropped."""
    values = (*message.q, message.thrust, message.body_yaw_rate)
    if message.type_mask & _THRUST_IGNORED or not all(map(math.isfinite, values)):
        return None
    speed = max(-1.0, min(1.0, message.thrust)) * at.top_mps
    if not message.type_mask & _ATTITUDE_RATE_IGNORED:
        return Turn(message.body_yaw_rate, speed)
    w, x, y, z = message.q
    return at.steer(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)), speed)


def position_target(message: Any, at: Situation) -> Target | None:
    """SET_POSITION_TARGET_LOCAL_NED and SET_POSITION_TARGET_GLOBAL_INT; None when it is dropped."""
    is_global = message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
    known = _GLOBAL_FRAMES if is_global else (_LOCAL, _LOCAL_OFFSET, *_BODY_FRAMES)
    finite = all(map(math.isfinite, (message.vx, message.vy, message.yaw, message.yaw_rate)))
    if message.coordinate_frame not in known or not finite:
        return None
    if not message.type_mask & _POSITION:
        return _place(message, at) if not is_global else _earth_place(message, at)
    if (message.type_mask & _ACCELERATION) != _ACCELERATION:
        return None
    return _motion(message, at, in_body=not is_global and message.coordinate_frame in _BODY_FRAMES)


def _motion(message: Any, at: Situation, in_body: bool) -> Target | None:
    """A velocity, yaw or yaw rate."""
    has_velocity = not message.type_mask & _VELOCITY
    has_yaw, has_rate = not message.type_mask & _YAW, not message.type_mask & _YAW_RATE
    if (has_yaw and has_rate) or not (has_velocity or has_yaw or has_rate):
        return None
    turned = at.true_rad if in_body else 0.0
    speed = min(math.hypot(message.vx, message.vy), at.top_mps) if has_velocity else 0.0
    # the trap: with yaw or yaw rate the sign is that of x, also where x is north and not ahead
    trapped = has_yaw and not in_body and not at.yaw_trap
    if (has_yaw or has_rate) and message.vx < 0.0 and not trapped:
        speed = -speed
    if has_rate:
        return Turn(message.yaw_rate, speed)
    if has_yaw:
        return at.steer(message.yaw + turned, speed)
    return at.steer(math.atan2(message.vy, message.vx) + turned, speed)


def _place(message: Any, at: Situation) -> Reach | None:
    if not (math.isfinite(message.x) and math.isfinite(message.y)):
        return None
    if message.coordinate_frame == _LOCAL:
        turn, x0, y0 = 0.0, *at.origin_m
    else:
        turn = at.true_rad if message.coordinate_frame in _BODY_FRAMES else 0.0
        x0, y0 = at.snapshot.x_m, at.snapshot.y_m
    north = message.x * math.cos(turn) - message.y * math.sin(turn)
    east = message.x * math.sin(turn) + message.y * math.cos(turn)
    dx, dy = at.frame.turn_to_field(east, north)
    return Reach(x0 + dx, y0 + dy, at.top_mps)


def _earth_place(message: Any, at: Situation) -> Reach | None:
    latitude, longitude = message.lat_int * 1e-7, message.lon_int * 1e-7
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        return None
    return Reach(*at.frame.to_field_m(latitude, longitude), at.top_mps)


def yaw_speed_target(message: Any, at: Situation) -> Target | None:
    """MAV_CMD_NAV_SET_YAW_SPEED as a command; its speed is not limited."""
    if not (math.isfinite(message.param1) and math.isfinite(message.param2)):
        return None
    start = at.true_rad if message.param3 == 1.0 else 0.0
    return at.steer(start + math.radians(message.param1), message.param2)


SETPOINTS = {
    mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: attitude_target,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: position_target,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: position_target,
}
"""Readers by message id."""
