"""One simulated boat and a ground station beside it, without sockets or threads: time moves when told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.sim_boats import AutopilotSettings, RadioSettings, SimBoat
from steerclear.experiments.sim_boats.boat import Boat, Setting
from steerclear.shield.bridge.frame import FieldFrame

TICK_S = 0.02
ID = 7
ARM, MODE, INTERVAL = (
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
)


class Bench:
    """A boat and its ground station.

    Attributes:
        heard: (time s, message) that reached the ground, in order.
        now_s: simulated time.
    """

    def __init__(
        self,
        platform: str = "heron",
        y_axis_deg: float = 0.0,
        radio: RadioSettings | None = None,
        key: bytes | None = None,
        noise: float = 0.0,
        boot_s: float = 0.0,
        **autopilot: Any,
    ) -> None:
        self.frame = FieldFrame(42.0, -71.0, y_axis_deg)
        settings = AutopilotSettings(boot_s=boot_s, **autopilot)
        setting = Setting(self.frame, settings, radio or RadioSettings(), noise, key)
        self.boat = Boat(SimBoat("b", platform), (10.0, 10.0, 0.0), ID, setting, np.random.SeedSequence(1))
        self.boat.write = self._take
        self.ground = mavlink.MAVLink(None, 255, 190)
        self.reader = mavlink.MAVLink(None)
        self.heard: list[tuple[float, Any]] = []
        self.packets: list[bytes] = []
        self.now_s = 0.0
        self._ticks = 0

    def _take(self, packet: bytes) -> None:
        self.packets.append(packet)
        self.heard.append((self.now_s, self.reader.decode(bytearray(packet))))

    def say(self, message: Any) -> None:
        """Send a message to the boat."""
        packet = message.pack(self.ground)
        self.ground.seq = (self.ground.seq + 1) % 256
        self.boat.hear(bytes(packet), self.now_s)

    def run(self, seconds: float, message: Any = None, every_s: float = 0.1) -> None:
        """Let time pass, saying something again and again."""
        for _ in range(round(seconds / TICK_S)):
            if message is not None and self._ticks % round(every_s / TICK_S) == 0:
                self.say(message)
            self._ticks += 1
            self.now_s = self._ticks * TICK_S
            if self._ticks % 5 == 0:
                self.boat.step(self.now_s)
            self.boat.tick(self.now_s)

    def command(self, command: int, *parameters: float, target: int = ID) -> int | None:
        """Send COMMAND_LONG and return its acknowledgement, None without one."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        before = len(self.heard)
        self.say(mavlink.MAVLink_command_long_message(target, 1, command, 0, *values))
        acks = [m for _, m in self.heard[before:] if m.get_type() == "COMMAND_ACK" and m.command == command]
        return acks[-1].result if acks else None

    def guided(self) -> Bench:
        """Arm, in GUIDED."""
        self.run(0.1)
        assert self.command(MODE, 1, 15) == 0
        assert self.command(ARM, 1) == 0
        return self

    def last(self, kind: str) -> Any:
        """The latest message of a type."""
        return next(m for _, m in reversed(self.heard) if m.get_type() == kind)

    def times(self, kind: str) -> list[float]:
        """When messages of a type came."""
        return [t for t, m in self.heard if m.get_type() == kind]

    def texts(self) -> list[str]:
        """What the autopilot said."""
        return [m.text for _, m in self.heard if m.get_type() == "STATUSTEXT"]

    @property
    def hull(self) -> Any:
        """The boat's hull."""
        return self.boat.hull


def attitude(heading_rad: float, thrust: float, mask: int = 7, rate: float = 0.0, target: int = ID) -> Any:
    """SET_ATTITUDE_TARGET."""
    q = [math.cos(heading_rad / 2.0), 0.0, 0.0, math.sin(heading_rad / 2.0)]
    return mavlink.MAVLink_set_attitude_target_message(0, target, 1, mask, q, 0.0, 0.0, rate, thrust)


def velocity(north: float, east: float, mask: int = 3527, frame: int = 1, yaw: float = 0.0, rate: float = 0.0) -> Any:
    """SET_POSITION_TARGET_LOCAL_NED with a velocity."""
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, ID, 1, frame, mask, 0, 0, 0, north, east, 0, 0, 0, 0, yaw, rate
    )


def stream(bench: Bench, message: int, rate_hz: float) -> int | None:
    """Ask for a message at a rate."""
    return bench.command(INTERVAL, message, 1e6 / rate_hz)
