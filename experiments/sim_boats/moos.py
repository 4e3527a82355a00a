"""`Community`: what one simulated boat has aboard instead of a MAVLink autopilot: a MOOSDB of its own, and a PID."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable

from steerclear.shield.bridge.fleet_checks import MOOS, address_of
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.moos.stand_in import StandInActuators, StandInDb, StandInPid
from steerclear.shield.bridge.moos.wire import Message
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform

from .hull import STEP_S, Actuate, Coast, Order, Steer
from .sensing import Snapshot

SIMULATOR, PID, REPORTER, RELAY = "uSimMarine", "pMarinePID", "pNodeReporter", "uFldNodeComms"
REPORT_S, NAV_S = 0.5, 0.1  # between NODE_REPORTs, and between NAV_*, simulated s
LOOPBACK = "127.0.0.1"


class Community:
    """A stand-in MOOSDB at the boat's address, the simulator's NAV_* in it, and a PID that obeys what is written there.

    Args:
        boat: its name.
        address: moos://HOST:PORT, on this machine.
        frame: where the field is; its corner is the local grid's origin.
        warp: times faster than real time.
        precbf: of a boat whose PID posts rudder and thrust as *_PRECBF, its platform; its hull then obeys the plain
            names alone. None: the PID moves the hull.

    Raises:
        ConfigError: the address is elsewhere, the port is taken, or the platform has no rudder and thrust.
    """

    def __init__(self, boat: str, address: str, frame: FieldFrame, warp: float, precbf: Platform | None = None) -> None:
        host, port = address_of(address.removeprefix(MOOS), f"boat {boat!r}: link")
        if host not in (LOOPBACK, "localhost"):
            raise ConfigError(f"{address!r} is not on this machine; a stand-in MOOSDB is on {LOOPBACK} only")
        self._boat, self._frame, self.pid = boat, frame, StandInPid()
        self.actuators = None if precbf is None else StandInActuators(precbf, STEP_S)
        self._seen: Snapshot | None = None
        try:
            self.db = StandInDb(boat, port, warp, self._hear)
        except OSError as error:
            raise ConfigError(f"{address}: {error.strerror}; end what has the port, such as a MOOSDB") from None
        self._nav_s = self._report_s = -math.inf
        self.frozen_nav: Snapshot | None = None
        self.post("MOOS_MANUAL_OVERRIDE", "false", "uTimerScript")
        self.post("IVPHELM_STATE", "DRIVE", "pHelmIvP")

    @property
    def is_commanded(self) -> bool:
        """Whether its PID obeys somebody at this moment."""
        if self.actuators is not None:
            return self.actuators.is_driven(self.db.now_s())
        return self.pid.command(self.db.now_s()) is not None

    def order(self) -> Order:
        """What the PID makes of what was written last; behind *_PRECBF, what the plain names say."""
        command = self.pid.command(self.db.now_s())
        if self.actuators is not None:
            return self._actuate(self.actuators, command)
        if command is None:
            return Coast()
        heading_deg, speed_mps = command
        return Steer(self._frame.heading_to_field_rad(math.radians(heading_deg)), speed_mps)

    def publish(self, seen: Snapshot) -> None:
        """Write NAV_*, all of one stamp; a boat whose PID was told what is no number has none left."""
        if seen.time_s - self._nav_s < NAV_S - 1e-6:
            return
        self._nav_s = seen.time_s
        seen = self._seen = self.frozen_nav or seen
        x, y = self._frame.turn_to_earth(seen.x_m, seen.y_m)
        heading_deg = math.degrees(self._frame.heading_to_true_rad(seen.heading_rad))
        values = {"NAV_X": x, "NAV_Y": y, "NAV_HEADING": heading_deg, "NAV_SPEED": round(seen.speed_mps, 2)}
        values |= {"NAV_LAT": seen.latitude_deg, "NAV_LONG": seen.longitude_deg}
        stamp = self.db.now_s()
        for key, value in values.items():
            self.db.post(key, math.nan if self.pid.broken else value, SIMULATOR, stamp)

    def report(self, others: Iterable[tuple[str, int, Snapshot]], time_s: float) -> None:
        """Write the NODE_REPORTs of all boats as a relay would: name, team, and what each one's sensors say."""
        if time_s - self._report_s < REPORT_S - 1e-6:
            return
        self._report_s = time_s
        for name, team, seen in others:
            own = name == self._boat
            text = self._report_text(name, team, seen)
            self.post("NODE_REPORT_LOCAL" if own else "NODE_REPORT", text, REPORTER if own else RELAY)

    def post(self, key: str, value: float | str, source: str) -> None:
        """Write a variable as an app aboard would."""
        self.db.post(key, value, source)

    def close(self) -> None:
        """End the MOOSDB."""
        with contextlib.suppress(RuntimeError):
            self.db.close()

    def _hear(self, message: Message) -> None:
        self.pid.hear(message, self.db.now_s())
        if self.actuators is not None:
            self.actuators.hear(message, self.db.now_s())

    def _actuate(self, actuators: StandInActuators, command: tuple[float, float] | None) -> Order:
        if self._seen is not None:
            heading_deg = math.degrees(self._frame.heading_to_true_rad(self._seen.heading_rad))
            for key, value in actuators.wants(command, heading_deg, self._seen.speed_mps).items():
                self.post(key, value, PID)
        return Actuate(actuators.rudder, actuators.thrust)

    def _report_text(self, name: str, team: int, seen: Snapshot) -> str:
        x, y = self._frame.turn_to_earth(seen.x_m, seen.y_m)
        heading_deg = math.degrees(self._frame.heading_to_true_rad(seen.heading_rad))
        return (
            f"NAME={name},X={x:.2f},Y={y:.2f},SPD={seen.speed_mps:.2f},HDG={heading_deg:.2f},DEP=0,"
            f"LAT={seen.latitude_deg:.8f},LON={seen.longitude_deg:.8f},TYPE=HERON,GROUP={('blue', 'red')[team % 2]},"
            f"MODE=DRIVE,ALLSTOP=clear,TIME={self.db.now_s():.3f},LENGTH=1.3"
        )
