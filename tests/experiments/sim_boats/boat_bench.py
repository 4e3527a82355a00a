"""One simulated boat and a ground station beside it, without sockets or threads: time moves when told."""

import math

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.sim_boats import AutopilotSettings, RadioSettings, SimBoat
from steerclear.experiments.sim_boats.boat import Boat, Setting
from steerclear.shield.bridge.frame import FieldFrame

TICK_S = 0.02
ID = 7
ARM, MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


class Bench:
    """A boat and its ground station.

    Attributes:
        heard: (time s, message) that reached the ground, in order.
        now_s: simulated time.
    """

    def __init__(self, platform="heron", y_axis_deg=0.0, key=None, noise=0.0, boot_s=0.0, **autopilot):
        self.frame = FieldFrame(42.0, -71.0, y_axis_deg)
        settings = AutopilotSettings(boot_s=boot_s, **autopilot)
        setting = Setting(self.frame, settings, RadioSettings(), noise, key)
        self.boat = Boat(SimBoat("b", platform), (10.0, 10.0, 0.0), ID, setting, np.random.SeedSequence(1))
        self.boat.write = self._take
        self.ground = mavlink.MAVLink(None, 255, 190)
        self.reader = mavlink.MAVLink(None)
        self.heard = []
        self.packets = []
        self.now_s = 0.0
        self._ticks = 0

    def _take(self, packet):
        self.packets.append(packet)
        self.heard.append((self.now_s, self.reader.decode(bytearray(packet))))

    def say(self, message):
        """Send a message to the boat."""
        packet = message.pack(self.ground)
        self.ground.seq = (self.ground.seq + 1) % 256
        self.boat.hear(bytes(packet), self.now_s)

    def run(self, seconds, message=None, every_s=0.1):
        """Let time pass, saying something again and again."""
        for _ in range(round(seconds / TICK_S)):
            if message is not None and self._ticks % round(every_s / TICK_S) == 0:
                self.say(message)
            self._ticks += 1
            self.now_s = self._ticks * TICK_S
            if self._ticks % 5 == 0:
                self.boat.step(self.now_s)
            self.boat.tick(self.now_s)

    def command(self, command, *parameters, target=ID):
        """Send COMMAND_LONG and return its acknowledgement, None without one."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        before = len(self.heard)
        self.say(mavlink.MAVLink_command_long_message(target, 1, command, 0, *values))
        acks = [m for _, m in self.heard[before:] if m.get_type() == "COMMAND_ACK" and m.command == command]
        return acks[-1].result if acks else None

    def guided(self):
        """Arm, in GUIDED."""
        self.run(0.1)
        assert self.command(MODE, 1, 15) == 0
        assert self.command(ARM, 1) == 0
        return self

    def last(self, kind):
        """The latest message of a type."""
        return next(m for _, m in reversed(self.heard) if m.get_type() == kind)

    def times(self, kind):
        """When messages of a type came."""
        return [t for t, m in self.heard if m.get_type() == kind]

    def texts(self):
        """What the autopilot said."""
        return [m.text for _, m in self.heard if m.get_type() == "STATUSTEXT"]

    @property
    def hull(self):
        """The boat's hull."""
        return self.boat.hull


def attitude(heading_rad, thrust, mask=7, rate=0.0, target=ID):
    """SET_ATTITUDE_TARGET."""
    q = [math.cos(heading_rad / 2.0), 0.0, 0.0, math.sin(heading_rad / 2.0)]
    return mavlink.MAVLink_set_attitude_target_message(0, target, 1, mask, q, 0.0, 0.0, rate, thrust)


def velocity(north, east, mask=3527, frame=1, yaw=0.0, rate=0.0):
    """SET_POSITION_TARGET_LOCAL_NED with a velocity."""
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, ID, 1, frame, mask, 0, 0, 0, north, east, 0, 0, 0, 0, yaw, rate
    )


def stream(bench, message, rate_hz):
    """Ask for a message at a rate."""
    return bench.command(INTERVAL, message, 1e6 / rate_hz)
