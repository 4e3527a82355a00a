"""One simulated boat: hull, sensors, autopilot and both directions of its radio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from steerclear.shield.bridge.fleet_checks import MOOS
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.platforms import get_platform

from .autopilot import Autopilot
from .faults import Faults
from .hull import Hull, Keep, Order
from .moos import Community
from .sensing import Radio, Sensors
from .settings import AutopilotSettings, RadioSettings, SimBoat
from .vehicle import Mode


@dataclass(frozen=True)
class Setting:
    """What all boats of a fleet share; noise: 0 none, 1 as measured; warp: times faster than real time."""

    frame: FieldFrame
    autopilot: AutopilotSettings
    radio: RadioSettings
    noise: float = 0.0
    key: bytes | None = None
    warp: float = 1.0


class Boat:
    """One boat; it starts at x m, y m, heading deg.

    Attributes:
        hull, autopilot, faults: its parts.
        down, up: its radio, to and from the commander.
        order: what its hull was told last.
        seen: what its sensors say, from its last step.
        write: takes the packets that reach the commander.
        community: what it has aboard instead of its autopilot where it runs MOOS; None: it does not.
    """

    def __init__(
        self,
        spec: SimBoat,
        start: tuple[float, float, float],
        system_id: int,
        setting: Setting,
        seed: np.random.SeedSequence,
    ) -> None:
        seeds = [np.random.default_rng(child) for child in seed.spawn(4)]
        platform, frame = get_platform(spec.platform), setting.frame
        self.spec, self.system_id = spec, system_id
        self.hull = Hull(platform, *start, setting.autopilot.brake_mps2)
        self.down, self.up = Radio(setting.radio, seeds[0]), Radio(setting.radio, seeds[1])
        self._sensors = Sensors(frame, setting.noise, seeds[2])
        self.write: Callable[[bytes], None] = lambda packet: None
        self.seen = self._sensors.sense(self.hull, 0.0)
        top = dict.fromkeys(("WP_SPEED", "CRUISE_SPEED"), platform.max_speed_mps)  # unless it is told otherwise
        settings = replace(setting.autopilot, parameters={**top, **setting.autopilot.parameters})
        self.autopilot = Autopilot(system_id, settings, frame, self.seen, self.down, setting.key)
        self.faults = Faults(self.autopilot, self.down, self.up, frame, seeds[3])
        self.community: Community | None = None
        if spec.address is not None and spec.address.startswith(MOOS):
            precbf = platform if spec.gate == "pid" else None
            self.community = Community(spec.name, spec.address, frame, setting.warp, precbf)
        self.order: Order = Keep()

    @property
    def has_link(self) -> bool:
        """Whether anybody can command it."""
        return self.spec.address is not None

    @property
    def is_commanded(self) -> bool:
        """Whether it obeys a commander at this moment."""
        if self.community is not None:
            return self.community.is_commanded
        vehicle = self.autopilot.vehicle
        return vehicle.armed and vehicle.target is not None

    @property
    def is_held(self) -> bool:
        """Whether its autopilot is in HOLD."""
        return self.autopilot.vehicle.mode is Mode.HOLD

    def step(self, time_s: float, order: Order | None = None) -> None:
        """Move by one step, to ``time_s``, as given, else as who steers it aboard orders."""
        aboard = self.autopilot.vehicle if self.community is None else self.community
        self.order = aboard.order() if order is None else order
        self.hull.obey(self.faults.misled(self.order))
        self.seen = self._sensors.sense(self.hull, time_s)

    def tick(self, now_s: float) -> None:
        """Let the autopilot look at its clocks and send, and the radio deliver."""
        self.faults.tick(now_s)
        if self.community is not None:
            self.community.publish(self.faults.sensed(self.seen, now_s))
            return
        for packet in self.up.take(now_s):
            self.autopilot.receive(packet, now_s)
        if self.autopilot.reboot_wanted:  # the boat runs on without motors
            self.hull.forget()
            self.autopilot.boot(now_s)
        self.autopilot.snapshot = self.faults.sensed(self.seen, now_s)
        if self.has_link and not self.faults.is_dark:
            self.autopilot.tick(now_s)
            self._deliver(now_s)

    def hear(self, packet: bytes, now_s: float) -> None:
        """A packet leaves for this boat."""
        self.up.put(packet, now_s)
        for arrived in self.up.take(now_s):
            self.autopilot.receive(arrived, now_s)
        self._deliver(now_s)

    def _deliver(self, now_s: float) -> None:
        for packet in self.down.take(now_s):
            self.write(packet)
