"""COMMAND_LONG and COMMAND_INT: what each does and how it is acknowledged."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .modes import Mode
from .orders import Steer, Turn
from .setpoints import yaw_speed_target

if TYPE_CHECKING:
    from .autopilot import Autopilot

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
FAILED = mavlink.MAV_RESULT_FAILED

_FORCE = 21196.0
"""Second parameter of an arming command that skips the checks."""


def _arm(boat: Autopilot, message: Any) -> int:
    if message.param1 == 1.0:
        return ACCEPTED if boat.vehicle.arm(boat.now_s, message.param2 == _FORCE) else FAILED
    if message.param1 == 0.0:
        boat.vehicle.disarm()
        return ACCEPTED
    return UNSUPPORTED


def _set_mode(boat: Autopilot, message: Any) -> int:
    return change_mode(boat, int(message.param1), message.param2)


def change_mode(boat: Autopilot, base: int, number: float) -> int:
    """Change mode as DO_SET_MODE and SET_MODE ask; the result to acknowledge."""
    if not base & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return DENIED
    whole = int(number) if 0.0 <= number <= 255.0 else -1
    return ACCEPTED if boat.vehicle.set_mode(whole, boat.now_s) else FAILED


def _set_interval(boat: Autopilot, message: Any) -> int:
    return ACCEPTED if boat.streams.set_interval(int(message.param1), message.param2) else FAILED


def _get_interval(boat: Autopilot, message: Any) -> int:
    wanted = int(message.param1)
    boat.send(mavlink.MAVLink_message_interval_message(wanted, boat.streams.interval_us(wanted)))
    return ACCEPTED


def _request(boat: Autopilot, message: Any) -> int:
    return ACCEPTED if boat.send_now(int(message.param1)) else FAILED


def _request_version(boat: Autopilot, message: Any) -> int:
    boat.send_now(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    return ACCEPTED


def _change_speed(boat: Autopilot, message: Any) -> int:
    follows_commands = boat.vehicle.mode is Mode.GUIDED and isinstance(boat.vehicle.target, (Steer, Turn))
    return FAILED if follows_commands else ACCEPTED


def _yaw_speed(boat: Autopilot, message: Any) -> int:
    if not boat.vehicle.settings.firmware.yaw_speed_command:
        return UNSUPPORTED
    target = yaw_speed_target(message, boat.situation())
    return ACCEPTED if target is not None and boat.vehicle.take(target, boat.now_s) else FAILED


def _reboot(boat: Autopilot, message: Any) -> int:
    if message.param1 not in (1.0, 3.0):
        return DENIED
    boat.reboot_wanted = True
    return ACCEPTED


COMMANDS: dict[int, Callable[[Autopilot, Any], int]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _request_version,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_NAV_SET_YAW_SPEED: _yaw_speed,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
}
"""Handlers by command; any other is unsupported."""
