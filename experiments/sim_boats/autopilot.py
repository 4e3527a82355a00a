"""One boat's autopilot: MAVLink bytes in, MAVLink bytes out, and orders for its hull.

SET_* messages that runners send are read as the measured autopilot reads them; none is acknowledged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.connection import Codec
from steerclear.shield.bridge.mavlink.signing import Signing

from .hull import Steer, Turn
from .sensing import Radio, Snapshot
from .settings import AutopilotSettings
from .vehicle import CAN_SEND, PARAMETERS, Streams, Telemetry, Vehicle

COMPONENT = 1
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
UNSUPPORTED, FAILED = mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_FAILED

_TEXT_BYTES = 50
_FORCE = 21196.0  # second parameter of an arming command that skips the checks
_VELOCITY_ONLY, _LOCAL_FRAMES = 3527, (1, 7)
_ATTITUDE_RATE_IGNORED, _THRUST_IGNORED = 4, 64


class Autopilot:
    """One boat behind MAVLink, read and written by the runner's own codec; ``down``: radio to the commander.

    Without a signing key of 32 bytes packets are not signed and any is accepted.

    Attributes:
        vehicle: its logic.
        streams: what it sends how often.
        snapshot: its present state as its sensors say; set it after each step.
        now_s: simulated time.
        reboot_wanted: it was told to restart; whoever owns it calls `boot`.
        counts: packets taken, refused, ignored.

    Raises:
        ConfigError: a parameter it does not have, or a key of another length.
    """

    def __init__(
        self,
        system_id: int,
        settings: AutopilotSettings,
        frame: FieldFrame,
        snapshot: Snapshot,
        down: Radio,
        key: bytes | None = None,
    ) -> None:
        self.system_id, self.frame, self.snapshot = system_id, frame, snapshot
        self.vehicle = Vehicle(settings)
        self.vehicle.set_parameter("SYSID_THISMAV", system_id)
        self.counts = {"taken": 0, "refused": 0, "ignored": 0}
        self._down, self._signing = down, None if key is None else Signing(key)
        self.boot(snapshot.time_s)

    def boot(self, now_s: float) -> None:
        """Power on, or restart: everything but the parameters and the key is forgotten."""
        self.now_s, self.reboot_wanted = now_s, False
        self.vehicle.boot(now_s)
        self.streams = Streams(self.vehicle.settings.top_rate_hz, frozenset(CAN_SEND))
        self._telemetry = Telemetry(self.vehicle, self.frame)
        self._codec = Codec(self.system_id, COMPONENT, self._signing)

    def tick(self, now_s: float) -> None:
        """Look at the clocks and send what is due."""
        self.now_s = now_s
        self.vehicle.tick(now_s)
        while self.vehicle.texts:
            severity, text = self.vehicle.texts.popleft()
            self._send(mavlink.MAVLink_statustext_message(severity, text.encode()[:_TEXT_BYTES]))
        for message in self.streams.due(now_s):
            self._send_now(message)

    def receive(self, packet: bytes, now_s: float) -> None:
        """Take one packet; what is damaged, wrongly signed or for others has no effect."""
        self.now_s = now_s
        message, _ = self._codec.decode(packet)
        if message is None:
            self.counts["refused"] += 1
            return
        handler = _HANDLERS.get(message.get_type())
        if handler is None or getattr(message, "target_system", 0) not in (0, self.system_id):
            self.counts["ignored"] += 1
            return
        self.counts["taken"] += 1
        handler(self, message)

    def _send(self, message: Any) -> None:
        self._down.put(self._codec.encode(message), self.now_s)

    def _send_now(self, message: int) -> int:
        """Send one of the known messages, outside its interval; the result to acknowledge."""
        if message not in CAN_SEND:
            return FAILED
        self._send(self._telemetry.build(message, self.snapshot, self.now_s))
        return ACCEPTED

    def _acknowledge(self, command: int, result: int, message: Any) -> None:
        who = (message.get_srcSystem(), message.get_srcComponent())
        self._send(mavlink.MAVLink_command_ack_message(command, result, 0, 0, *who))

    def _on_target(self, message: Any) -> None:
        read = attitude_target if message.get_type() == "SET_ATTITUDE_TARGET" else position_target
        target = read(message, self)
        self.counts["ignored"] += target is None or not self.vehicle.take(target, self.now_s)

    def _on_command(self, message: Any) -> None:
        handler = _COMMANDS.get(message.command)
        usable = math.isfinite(message.param1) and math.isfinite(message.param2)
        result = UNSUPPORTED if handler is None or not usable else handler(self, message)
        self._acknowledge(message.command, result, message)

    def _on_set_mode(self, message: Any) -> None:
        result = _change_mode(self, message.base_mode, message.custom_mode)
        self._acknowledge(mavlink.MAVLINK_MSG_ID_SET_MODE, result, message)

    def _on_heartbeat(self, message: Any) -> None:
        if message.get_srcSystem() == int(self.vehicle.parameters["SYSID_MYGCS"]):
            self.vehicle.ground_s = self.now_s

    def _on_time(self, message: Any) -> None:
        if message.tc1 == 0:
            uptime_ns = round((self.now_s - self.vehicle.booted_s) * 1e9)
            self._send(mavlink.MAVLink_timesync_message(max(uptime_ns, 1), message.ts1))

    def _on_parameter_read(self, message: Any) -> None:
        names, index = list(self.vehicle.parameters), message.param_index
        self._send_parameter(message.param_id.rstrip("\0") if index < 0 else "".join(names[index : index + 1]))

    def _on_parameter_list(self, message: Any) -> None:
        for name in self.vehicle.parameters:
            self._send_parameter(name)

    def _on_parameter_set(self, message: Any) -> None:
        name = message.param_id.rstrip("\0")
        if self.vehicle.set_parameter(name, message.param_value):
            self._send_parameter(name)

    def _send_parameter(self, name: str) -> None:
        """Answer with a parameter; of one that does not exist nothing is said."""
        table = self.vehicle.parameters
        if name in table:
            place = (PARAMETERS[name][1], len(table), list(table).index(name))
            self._send(mavlink.MAVLink_param_value_message(name.encode(), table[name], *place))


Target = Steer | Turn


def attitude_target(message: Any, boat: Autopilot) -> Target | None:
    """SET_ATTITUDE_TARGET; None when it is dropped."""
    values = (*message.q, message.thrust, message.body_yaw_rate)
    if message.type_mask & _THRUST_IGNORED or not all(map(math.isfinite, values)):
        return None
    speed = max(-1.0, min(1.0, message.thrust)) * boat.vehicle.parameters["WP_SPEED"]
    if not message.type_mask & _ATTITUDE_RATE_IGNORED:
        return Turn(message.body_yaw_rate, speed)
    w, x, y, z = message.q
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return Steer(boat.frame.heading_to_field_rad(heading), speed)


def position_target(message: Any, boat: Autopilot) -> Target | None:
    """SET_POSITION_TARGET_LOCAL_NED with a velocity alone; None when it is dropped, as all else is: nobody sends it."""
    if message.coordinate_frame not in _LOCAL_FRAMES or message.type_mask != _VELOCITY_ONLY:
        return None
    if not math.isfinite(message.vx) or not math.isfinite(message.vy):
        return None
    speed = min(math.hypot(message.vx, message.vy), boat.vehicle.parameters["WP_SPEED"])
    return Steer(boat.frame.heading_to_field_rad(math.atan2(message.vy, message.vx)), speed)


def _change_mode(boat: Autopilot, base: int, number: float) -> int:
    if not base & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if boat.vehicle.set_mode(int(number) if 0.0 <= number <= 255.0 else -1, boat.now_s) else FAILED


def _arm(boat: Autopilot, message: Any) -> int:
    if message.param1 == 1.0:
        return ACCEPTED if boat.vehicle.arm(boat.now_s, message.param2 == _FORCE) else FAILED
    if message.param1 == 0.0:
        boat.vehicle.armed = False
        return ACCEPTED
    return UNSUPPORTED


def _reboot(boat: Autopilot, message: Any) -> int:
    boat.reboot_wanted = boat.reboot_wanted or message.param1 in (1.0, 3.0)
    return ACCEPTED if message.param1 in (1.0, 3.0) else DENIED


_COMMANDS: dict[int, Callable[[Autopilot, Any], int]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_DO_SET_MODE: lambda boat, order: _change_mode(boat, int(order.param1), order.param2),
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: lambda boat, order: (
        ACCEPTED if boat.streams.set_interval(int(order.param1), order.param2) else FAILED
    ),
    mavlink.MAV_CMD_REQUEST_MESSAGE: lambda boat, order: boat._send_now(int(order.param1)),
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
}
"""What each of COMMAND_LONG and COMMAND_INT does and how it is acknowledged; any other is unsupported."""

_HANDLERS: dict[str, Callable[[Autopilot, Any], None]] = {
    "HEARTBEAT": Autopilot._on_heartbeat,
    "COMMAND_LONG": Autopilot._on_command,
    "COMMAND_INT": Autopilot._on_command,
    "SET_MODE": Autopilot._on_set_mode,
    "TIMESYNC": Autopilot._on_time,
    "PARAM_REQUEST_READ": Autopilot._on_parameter_read,
    "PARAM_REQUEST_LIST": Autopilot._on_parameter_list,
    "PARAM_SET": Autopilot._on_parameter_set,
    "SET_ATTITUDE_TARGET": Autopilot._on_target,
    "SET_POSITION_TARGET_LOCAL_NED": Autopilot._on_target,
}
