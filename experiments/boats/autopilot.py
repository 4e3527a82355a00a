"""One boat's autopilot: MAVLink bytes in, MAVLink bytes out, and orders for its hull."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.frame import FieldFrame

from .commands import COMMANDS, UNSUPPORTED, change_mode
from .parameters import Parameters
from .sensing import Snapshot
from .setpoints import SETPOINTS, Situation
from .settings import AutopilotSettings
from .signing import Gate, sign_outgoing
from .streams import Streams
from .telemetry import CAN_SEND, Telemetry
from .vehicle import Vehicle

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
