"""A pymavlink connection to a simulated fleet that lives only when told."""

import math
from contextlib import contextmanager

from pymavlink import mavutil
from steerclear.experiments.sim_boats import AutopilotSettings

READY = AutopilotSettings(boot_s=0.0)
STEP_S = 0.1


class Station:
    """A ground station on one address.

    Attributes:
        heard: messages so far.
    """

    def __init__(self, fleet, address):
        self.fleet = fleet
        self.link = mavutil.mavlink_connection(address, dialect="ardupilotmega", source_system=255)
        self.heard = []

    def run(self, seconds, each_step=None):
        """Let simulated time pass, listening."""
        for _ in range(round(seconds / STEP_S)):
            if each_step is not None:
                each_step()
            self.fleet.advance(STEP_S)
            while (message := self.link.recv_match(blocking=False)) is not None:
                self.heard.append(message)

    def call(self):
        """Say that we are there, so that boats that listen know where to send."""
        self.link.mav.heartbeat_send(6, 8, 0, 0, 0)

    def guide(self, boat):
        """Arm a boat in GUIDED, with its position at 20 Hz."""
        for command, *values in ((511, 33, 50_000), (176, 1, 15), (400, 1)):
            self.link.mav.command_long_send(boat, 1, command, 0, *values, *[0] * (7 - len(values)))

    def steer(self, boat, heading_rad, thrust):
        """Command heading and speed."""
        q = [math.cos(heading_rad / 2.0), 0.0, 0.0, math.sin(heading_rad / 2.0)]
        self.link.mav.set_attitude_target_send(0, boat, 1, 7, q, 0, 0, 0, thrust)

    def of(self, kind, boat):
        """Messages of a type from a boat."""
        return [m for m in self.heard if m.get_type() == kind and m.get_srcSystem() == boat]

    def positions(self, boat):
        """Time since boot s and field position m of each GLOBAL_POSITION_INT of a boat."""
        return [
            (m.time_boot_ms / 1000.0, *self.fleet.frame.to_field_m(m.lat * 1e-7, m.lon * 1e-7))
            for m in self.of("GLOBAL_POSITION_INT", boat)
        ]


@contextmanager
def station(fleet, address=""):
    """A station on a boat's address, the fleet closed at the end."""
    opened = None
    try:
        opened = Station(fleet, address or next(iter(fleet.addresses.values())))
        opened.call()
        yield opened
    finally:
        if opened is not None:
            opened.link.close()
        fleet.close()
