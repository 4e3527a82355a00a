"""One boat's autopilot: MAVLink bytes in, MAVLink bytes out, and orders for its hull.

SET_* messages are read as the measured autopilot reads them, traps included; none is acknowledged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame

from .hull import Reach, Steer, Turn
from .sensing import Snapshot
from .settings import AutopilotSettings
from .signing import Gate, sign_outgoing
from .telemetry import CAN_SEND, Telemetry
from .vehicle import Mode, Parameters, Streams, Vehicle

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


COMPONENT = 1
_TEXT_BYTES = 50


class Autopilot:
    """One boat behind MAVLink.

    Args:
        system_id: its MAVLink system id.
        settings: how it behaves.
        frame: where the field is.
        snapshot: its state at the start.
        write: takes each outgoing packet.
        key: signing key of 32 bytes; None: packets are not signed and any is accepted.

    Attributes:
        vehicle: its logic.
        streams: what it sends how often.
        snapshot: its present state as its sensors say; set it after each step.
        now_s: simulated time.
        reboot_wanted: it was told to restart; whoever owns it calls `boot`.
        counts: packets taken, refused, ignored.
    """

    def __init__(
        self,
        system_id: int,
        settings: AutopilotSettings,
        frame: FieldFrame,
        snapshot: Snapshot,
        write: Callable[[bytes], None],
        key: bytes | None = None,
    ) -> None:
        self.system_id = system_id
        self.vehicle = Vehicle(settings, Parameters(settings.parameters, settings.firmware.timeout_parameter))
        self.vehicle.parameters.set("SYSID_THISMAV", system_id)
        self.streams = Streams(settings.top_rate_hz, CAN_SEND)
        self.telemetry = Telemetry(self.vehicle, frame)
        self.snapshot = snapshot
        self.now_s = snapshot.time_s
        self.reboot_wanted = False
        self.counts = {"taken": 0, "refused": 0, "ignored": 0}
        self._frame = frame
        self._write = write
        self._key = key
        self.boot(self.now_s)

    def boot(self, now_s: float) -> None:
        """Power on, or restart: everything but the parameters and the key is forgotten."""
        self.now_s = now_s
        self.reboot_wanted = False
        self.vehicle.boot(now_s)
        self.streams.reset()
        self.telemetry.origin = None
        self._mav = mavlink.MAVLink(self, self.system_id, COMPONENT)
        self._reader = mavlink.MAVLink(None)
        self._gate = None if self._key is None else Gate(self._key)
        if self._key is not None:
            sign_outgoing(self._mav, self._key)

    def write(self, packet: bytes) -> None:
        """Where pymavlink writes to."""
        self._write(bytes(packet))

    def send(self, message: Any) -> None:
        """Send a message."""
        self._mav.send(message)

    def send_now(self, message: int) -> bool:
        """Send one of the known messages, outside its interval; False when it cannot."""
        if message not in CAN_SEND:
            return False
        built = self.telemetry.build(message, self.snapshot, self.now_s)
        if built is not None:
            self.send(built)
        return built is not None

    def tick(self, now_s: float) -> None:
        """Look at the clocks and send what is due."""
        self.now_s = now_s
        self.vehicle.tick(now_s)
        while self.vehicle.texts:
            self._say(*self.vehicle.texts.popleft())
        for message in self.streams.due(now_s):
            self.send_now(message)

    def receive(self, packet: bytes, now_s: float) -> None:
        """Take one packet; what is damaged, wrongly signed or for others has no effect."""
        self.now_s = now_s
        message = self._read(packet)
        if message is None:
            self.counts["refused"] += 1
            return
        target = getattr(message, "target_system", 0)
        handler = _HANDLERS.get(message.get_msgId())
        if handler is None or target not in (0, self.system_id):
            self.counts["ignored"] += 1
            return
        self.counts["taken"] += 1
        handler(self, message)

    def _read(self, packet: bytes) -> Any | None:
        try:
            message = self._reader.decode(bytearray(packet))
        except mavlink.MAVError:
            return None
        return message if self._gate is None or self._gate.admits(packet) else None

    def situation(self) -> Situation:
        """What it needs to know to read a target."""
        origin = self.telemetry.origin
        at = self.snapshot
        return Situation(
            self._frame,
            at,
            self.vehicle.parameters["WP_SPEED"],
            self.vehicle.settings.firmware.yaw_trap,
            (at.x_m, at.y_m) if origin is None else origin[2:],
        )

    def _say(self, severity: int, text: str) -> None:
        self.send(mavlink.MAVLink_statustext_message(severity, text.encode()[:_TEXT_BYTES]))

    def _on_setpoint(self, message: Any) -> None:
        target = SETPOINTS[message.get_msgId()](message, self.situation())
        if target is None or not self.vehicle.take(target, self.now_s):
            self.counts["ignored"] += 1

    def _on_command(self, message: Any) -> None:
        handler = COMMANDS.get(message.command)
        usable = all(math.isfinite(getattr(message, f"param{i}")) or i > 2 for i in range(1, 5))
        result = UNSUPPORTED if handler is None or not usable else handler(self, message)
        self._acknowledge(message.command, result, message)

    def _on_set_mode(self, message: Any) -> None:
        result = change_mode(self, message.base_mode, message.custom_mode)
        self._acknowledge(mavlink.MAVLINK_MSG_ID_SET_MODE, result, message)

    def _acknowledge(self, command: int, result: int, message: Any) -> None:
        who = (message.get_srcSystem(), message.get_srcComponent())
        self.send(mavlink.MAVLink_command_ack_message(command, result, 0, 0, *who))

    def _on_heartbeat(self, message: Any) -> None:
        if message.get_srcSystem() == int(self.vehicle.parameters["SYSID_MYGCS"]):
            self.vehicle.hear_ground(self.now_s)

    def _on_stream_request(self, message: Any) -> None:
        self.streams.set_group(message.req_stream_id, message.req_message_rate if message.start_stop else 0)

    def _on_time(self, message: Any) -> None:
        if message.tc1 == 0:
            uptime_ns = round(self.vehicle.uptime_s(self.now_s) * 1e9)
            self.send(mavlink.MAVLink_timesync_message(max(uptime_ns, 1), message.ts1))

    def _on_parameter_read(self, message: Any) -> None:
        names = self.vehicle.parameters.names
        index = message.param_index
        name = message.param_id.rstrip("\0") if index < 0 else names[index] if index < len(names) else ""
        self._send_parameter(name)

    def _on_parameter_list(self, message: Any) -> None:
        for name in self.vehicle.parameters.names:
            self._send_parameter(name)

    def _on_parameter_set(self, message: Any) -> None:
        name = message.param_id.rstrip("\0")
        if math.isfinite(message.param_value) and self.vehicle.parameters.set(name, message.param_value):
            self._send_parameter(name)

    def _send_parameter(self, name: str) -> None:
        """Answer with a parameter; of one that does not exist nothing is said."""
        table = self.vehicle.parameters
        if name in table:
            index = table.names.index(name)
            self.send(
                mavlink.MAVLink_param_value_message(
                    name.encode(), table[name], table.type_of(name), len(table.names), index
                )
            )


_HANDLERS: dict[int, Callable[[Autopilot, Any], None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Autopilot._on_heartbeat,
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: Autopilot._on_command,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: Autopilot._on_command,
    mavlink.MAVLINK_MSG_ID_SET_MODE: Autopilot._on_set_mode,
    mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: Autopilot._on_stream_request,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: Autopilot._on_time,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: Autopilot._on_parameter_read,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: Autopilot._on_parameter_list,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: Autopilot._on_parameter_set,
} | dict.fromkeys(SETPOINTS, Autopilot._on_setpoint)
