"""Modes of ArduPilot Rover, what a heartbeat says of them, and which autopilots these links drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

MODES = {
    0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE", 8: "DOCK", 9: "CIRCLE",
    10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED", 16: "INITIALISING",
}  # fmt: skip
NUMBERS = {name: number for number, name in MODES.items()}
GUIDED = "GUIDED"
HOLD = "HOLD"

_BOATS = (mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_TYPE_GROUND_ROVER)
_NO_VEHICLES = (
    mavlink.MAV_TYPE_GCS,
    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
    mavlink.MAV_TYPE_GIMBAL,
    mavlink.MAV_TYPE_ADSB,
)


@dataclass(frozen=True)
class Heartbeat:
    """What a boat's heartbeat says.

    Attributes:
        mode: name of the mode.
        armed: whether motors may turn.
        unfit: why this link cannot drive it; empty when it can.
        received_s: on our clock, s.
    """

    mode: str
    armed: bool
    unfit: str
    received_s: float


def read_heartbeat(message: Any, received_s: float) -> Heartbeat | None:
    """What it says; None when it is no vehicle's."""
    if message.type in _NO_VEHICLES:
        return None
    mode = MODES.get(message.custom_mode, f"MODE {message.custom_mode}")
    armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    return Heartbeat(mode, armed, _unfit(message), received_s)


def _unfit(message: Any) -> str:
    if message.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return f"its autopilot is {_name('MAV_AUTOPILOT', message.autopilot)}, not ArduPilot"
    if message.type not in _BOATS:
        return f"it is a {_name('MAV_TYPE', message.type)}, not a boat with ArduPilot Rover"
    return ""


def _name(enum: str, number: int) -> str:
    entry = mavlink.enums[enum].get(number)
    return f"{enum} {number}" if entry is None else str(entry.name)


def mode_request(system_id: int, component: int, mode: str) -> Any:
    """The command that asks for a mode."""
    return mavlink.MAVLink_command_long_message(
        system_id, component, mavlink.MAV_CMD_DO_SET_MODE, 0,
        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, NUMBERS[mode], 0, 0, 0, 0, 0,
    )  # fmt: skip


def arm_request(system_id: int, component: int) -> Any:
    """The command that asks to arm, all checks on."""
    return mavlink.MAVLink_command_long_message(
        system_id, component, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0
    )
