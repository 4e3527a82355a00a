"""One simulated boat: hull, sensors, autopilot and both directions of its radio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from steerclear.shield.bridge.fleet_checks import MOOS
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.platforms import get_platform

from .autopilot import Autopilot
from .faults import Faults
from .hull import Helmsman, Hull, Order
from .moos import Community
from .sensing import Radio, Sensors
from .settings import AutopilotSettings, RadioSettings, SimBoat
from .vehicle import Mode


@dataclass(frozen=True)
class Setting:
    """What all boats of a fleet share.

    Attributes:
        frame: where the field is.
        autopilot: how autopilots behave.
        radio: what the radio does.
        noise: of the sensors: 0 none, 1 as measured.
        key: signing key; None: unsigned.
        warp: times faster than real time.
    """

    frame: FieldFrame
    autopilot: AutopilotSettings
    radio: RadioSettings
    noise: float = 0.0
    key: bytes | None = None
    warp: float = 1.0


class Boat:
    """One boat.

    Args:
        spec: who it is.
        start: x m, y m, heading deg.
        system_id: of its autopilot.
        setting: what all boats share.
        seed: of its random numbers.

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
        platform = get_platform(spec.platform)
        self.spec = spec
        self.system_id = system_id
        self.hull = Hull.at(platform, *start, setting.autopilot.brake_mps2)
        self.helmsman = Helmsman(self.hull)
        self.down, self.up = Radio(setting.radio, seeds[0]), Radio(setting.radio, seeds[1])
        self._sensors = Sensors(setting.frame, setting.noise, seeds[2])
        self.write: Callable[[bytes], None] = _nowhere
        seen = self._sensors.sense(self.hull, 0.0)
        settings = _with_top_speed(setting.autopilot, platform.max_speed_mps)
        self.autopilot = Autopilot(system_id, settings, setting.frame, seen, self._transmit, setting.key)
        self.faults = Faults(self.autopilot, self.down, self.up, setting.frame, seeds[3])
        self.community: Community | None = None
        if spec.address is not None and spec.address.startswith(MOOS):
            precbf = platform if spec.gate == "pid" else None
            self.community = Community(spec.name, spec.address, setting.frame, setting.warp, precbf)
        self.order: Order = self._ordered()
        self.seen = seen

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
        """Move by one step, to ``time_s``, as its autopilot orders or as given."""
        self.order = self._ordered() if order is None else order
        self.helmsman.step(self.faults.misled(self.order))
        self.seen = self._sensors.sense(self.hull, time_s)

    def tick(self, now_s: float) -> None:
        """Let the autopilot look at its clocks and send, and the radio deliver."""
        self.faults.tick(now_s)
        if self.community is not None:
            self.community.publish(self.faults.sensed(self.seen, now_s))
            return
        for packet in self.up.take(now_s):
            self.autopilot.receive(packet, now_s)
        if self.autopilot.reboot_wanted:
            self.restart(now_s)
        self.autopilot.snapshot = self.faults.sensed(self.seen, now_s)
        if self.has_link and not self.faults.is_dark:
            self.autopilot.tick(now_s)
            self.deliver(now_s)

    def hear(self, packet: bytes, now_s: float) -> None:
        """A packet leaves for this boat."""
        self.up.put(packet, now_s)
        for arrived in self.up.take(now_s):
            self.autopilot.receive(arrived, now_s)
        self.deliver(now_s)

    def deliver(self, now_s: float) -> None:
        """Hand over what has crossed the radio."""
        for packet in self.down.take(now_s):
            self.write(packet)

    def restart(self, now_s: float) -> None:
        """The autopilot boots anew; the boat runs on without motors."""
        self.hull.forget()
        self.autopilot.boot(now_s)

    def _ordered(self) -> Order:
        """What it is told by who steers it aboard."""
        return self.autopilot.vehicle.order() if self.community is None else self.community.order()

    def _transmit(self, packet: bytes) -> None:
        self.down.put(packet, self.autopilot.now_s)


def _nowhere(packet: bytes) -> None:
    """Where packets go of a boat that nobody hears."""


def _with_top_speed(settings: AutopilotSettings, top_mps: float) -> AutopilotSettings:
    """Settings whose WP_SPEED is the platform's top speed, unless it is given."""
    parameters = {"WP_SPEED": top_mps, "CRUISE_SPEED": top_mps} | dict(settings.parameters)
    return AutopilotSettings(**{**vars(settings), "parameters": parameters})
