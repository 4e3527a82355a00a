"""Ways to command heading and speed that were seen to work, and choosing one by what the autopilot can.

Velocity with yaw drives boats backwards on every southward course, body-frame yaw is relative at receipt, and
MAV_CMD_NAV_SET_YAW_SPEED was removed: none of them is here.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...exceptions import LinkError, LinkRefused

ATTITUDE_MASK = 7
"""Body rates ignored: the quaternion and the thrust count."""
YAW_RATE_MASK = 3
"""Yaw rate counts, the quaternion does not."""
VELOCITY_MASK = 3527
"""Only the velocity counts."""
CREEP_MPS = 1e-3
"""A velocity of length zero has no direction: so slow a one keeps the heading."""
OLDEST = (4, 0)


@dataclass(frozen=True)
class Encoded:
    """A message and what it says after rounding: heading rad clockwise from true north, speed m/s, cut to a limit."""

    message: Any
    heading_rad: float
    speed_mps: float
    limit_mps: float = math.inf


class Route(Protocol):
    """One way to command heading and speed.

    Attributes:
        name: of the message.
    """

    name: str

    def encode(self, target: tuple[int, int], boot_ms: int, heading_rad: float, speed_mps: float) -> Encoded:
        """The message for a heading (rad clockwise from true north) and a speed (m/s)."""


class AttitudeRoute:
    """SET_ATTITUDE_TARGET: yaw of the quaternion, thrust as a share of WP_SPEED, negative astern.

    Args:
        top_mps: the autopilot's WP_SPEED, m/s, > 0.
    """

    name = "SET_ATTITUDE_TARGET"

    def __init__(self, top_mps: float) -> None:
        self.top_mps = top_mps

    def encode(self, target: tuple[int, int], boot_ms: int, heading_rad: float, speed_mps: float) -> Encoded:
        """See `Route`."""
        w, z = _float32(math.cos(0.5 * heading_rad)), _float32(math.sin(0.5 * heading_rad))
        thrust = _float32(min(1.0, max(-1.0, speed_mps / self.top_mps)))
        message = mavlink.MAVLink_set_attitude_target_message(
            boot_ms, *target, ATTITUDE_MASK, [w, 0.0, 0.0, z], 0.0, 0.0, 0.0, thrust
        )
        return Encoded(message, 2.0 * math.atan2(z, w) % (2.0 * math.pi), thrust * self.top_mps, self.top_mps)

    def straight_stop(self, target: tuple[int, int], boot_ms: int) -> Any:
        """Stop without turning, for a boat whose heading nobody knows."""
        return mavlink.MAVLink_set_attitude_target_message(
            boot_ms, *target, YAW_RATE_MASK, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.0
        )


class VelocityRoute:
    """SET_POSITION_TARGET_LOCAL_NED, velocity only; cannot go astern.

    Args:
        top_mps: the autopilot's WP_SPEED, m/s; None when it cannot be read.
    """

    name = "SET_POSITION_TARGET_LOCAL_NED"

    def __init__(self, top_mps: float | None) -> None:
        self.top_mps = top_mps

    def encode(self, target: tuple[int, int], boot_ms: int, heading_rad: float, speed_mps: float) -> Encoded:
        """See `Route`."""
        top = math.inf if self.top_mps is None else self.top_mps
        speed = min(top, max(CREEP_MPS, speed_mps))
        north, east = _float32(speed * math.cos(heading_rad)), _float32(speed * math.sin(heading_rad))
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            boot_ms, *target, mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_MASK,
            0.0, 0.0, 0.0, north, east, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip
        return Encoded(message, math.atan2(east, north) % (2.0 * math.pi), math.hypot(north, east), top)


ROUTES = (AttitudeRoute.name, VelocityRoute.name)


@dataclass(frozen=True)
class Abilities:
    """What an autopilot said of itself.

    Attributes:
        version: major, minor, patch; None when it did not say.
        capabilities: MAV_PROTOCOL_CAPABILITY bits; 0 when it did not say.
        top_mps: WP_SPEED, m/s; None when it did not say.
    """

    version: tuple[int, int, int] | None = None
    capabilities: int = 0
    top_mps: float | None = None

    def can(self, route: str) -> bool:
        """Whether the autopilot says it knows that message."""
        bit = (
            mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
            if route == AttitudeRoute.name
            else mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        )
        return bool(self.capabilities & bit)


def check_route(route: str) -> str:
    """The name of a route or "auto".

    Raises:
        LinkError: there is none of that name.
    """
    if route not in ("auto", *ROUTES):
        raise LinkError(f"there is no route {route!r}; give auto, {' or '.join(ROUTES)}")
    return route


def choose_route(boat: str, route: str, abilities: Abilities) -> AttitudeRoute | VelocityRoute:
    """The first way the autopilot can be commanded in.

    Raises:
        LinkRefused: the autopilot is too old, cannot do the route asked for, or would not move.
    """
    version, top = abilities.version, abilities.top_mps
    if version is not None and version[:2] < OLDEST:
        raise LinkRefused(f"boat {boat}: firmware {'.'.join(map(str, version))} is too old; install ArduPilot Rover 4")
    if top is not None and not 0.0 < top < math.inf:
        raise LinkRefused(f"boat {boat}: parameter WP_SPEED is {top:g}, so it would not move; set it to its top speed")
    for name in ROUTES if route == "auto" else (route,):
        if not abilities.can(name):
            continue
        if name == VelocityRoute.name:
            return VelocityRoute(top)
        if top is not None:
            return AttitudeRoute(top)
    raise LinkRefused(
        f"boat {boat}: no way to command heading and speed ({_lacks(route, abilities)}); "
        "give route auto, or install ArduPilot Rover 4 with guided control by MAVLink"
    )


def _lacks(route: str, abilities: Abilities) -> str:
    if not abilities.capabilities:
        return "it did not answer what it can do"
    wanted = ROUTES if route == "auto" else (route,)
    lacking = [name for name in wanted if not abilities.can(name)]
    return f"it cannot do {' or '.join(lacking)}" if lacking else "its WP_SPEED cannot be read"


def _float32(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
