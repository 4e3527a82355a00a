"""`MoosLinks`: the links of a fleet file's boats that run MOOS, and what their communities tell and want."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ...commands import Commands
from ...exceptions import ConfigError
from ..clock import Clock
from ..fleet_checks import MOOS, address_of
from ..fleet_file import FleetFile
from ..fleet_settings import BoatSettings, MoosLinkSettings
from ..messages import Answer, Link, LinkMaker, NominalSource
from . import POLICY
from .gates import HelmGate, PidGate
from .state import MoosContacts
from .vehicle import MoosLink


class MoosLinks(LinkMaker):
    """A `LinkMaker`: a client in each boat's own MOOSDB, and one `ContactSource` for all of them.

    Packets are not recorded: a community's own pLogger keeps what passes.
    """

    def __init__(self, fleet: FleetFile, clock: Clock, on_bytes: object = None) -> None:
        self._fleet, self._clock = fleet, clock
        self.contacts: dict[tuple[float, float], MoosContacts] = {}

    def link(self, boat: BoatSettings) -> MoosLink:
        """See `LinkMaker`."""
        settings = boat.link
        if not isinstance(settings, MoosLinkSettings):
            raise ValueError(f"boat {boat.name} has no link of MOOS")
        host, port = address_of(settings.address.removeprefix(MOOS), f"boat {boat.name!r}: link")
        frame, platform = self._fleet.frame, self._fleet.platform_of[boat.name]
        gate = PidGate(platform, self._fleet.dt_s) if settings.gate == "pid" else HelmGate(frame, settings.prefix)
        corner_m, prefix = settings.corner_m, settings.prefix
        error_m = self._fleet.shield_config.position_error_m
        contacts = self.contacts.setdefault(corner_m, MoosContacts(frame, corner_m, self._fleet.names, error_m))
        place = (boat.name, host.strip("[]"), port)
        return MoosLink(*place, gate, frame, self._clock, contacts, corner_m=corner_m, prefix=prefix)

    def sources(self) -> tuple[MoosContacts, ...]:
        """Who tells of other boats."""
        return tuple(self.contacts.values())


class MoosNominal(NominalSource):
    """A policy that is somebody else's: what the own community of each boat we command wants, through its gate.

    Raises:
        ConfigError: one of them has no moos:// link.
    """

    def __init__(self, fleet: FleetFile, boats: Sequence[str]) -> None:
        self._names, self._links = fleet.names, dict[str, MoosLink]()
        for boat in map(fleet.boat, boats):
            if not isinstance(boat.link, MoosLinkSettings):
                raise ConfigError(f"policy {POLICY} takes commands from MOOS, and boat {boat.name} has no {MOOS} link")

    def start(self) -> None:
        """Nothing runs beside us."""

    def use(self, links: Mapping[str, Link]) -> None:
        """Take commands from these links; until then nobody wants anything."""
        self._links = {name: link for name, link in links.items() if isinstance(link, MoosLink)}

    def latest(self) -> Answer:
        """The nominal commands now; a boat nobody commands is told to stop, which its link says in words."""
        values = np.full((len(self._names), 2), math.nan)
        for name, link in self._links.items():
            nominal = link.nominal()
            values[self._names.index(name)] = nominal.speed_mps, nominal.heading_rad
        return Answer(Commands.absolute_rad(values), 0.0)
