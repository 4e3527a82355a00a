"""Simulated boats from a FLEET.yaml, the very file that the runner reads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from steerclear.experiments.deploy.rules import game_config
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.fleet_settings import BoatSettings, MoosLinkSettings
from steerclear.shield.bridge.mavlink.signing import read_key
from steerclear.shield.platforms import Platform

from .hull import STEP_S
from .settings import SimBoat

_APART_M = 6.0

Hulls = Callable[[str, Platform], Platform]


def as_fleet(fleet: FleetFile | str | Path) -> FleetFile:
    """A fleet file, read when a path is given.

    Raises:
        FleetFileError: it cannot be used.
    """
    return fleet if isinstance(fleet, FleetFile) else load_fleet(fleet)


def boats_of(fleet: FleetFile, opponents: str, hulls: Hulls | None = None) -> list[SimBoat]:
    """The boats of a file; those of the game that the file's runner does not command are driven by ``opponents``.

    One of these that has a link tells where it is there, and obeys it as soon as it is commanded. ``hulls`` says what a
    boat, by its name and its platform of the file, really is.
    """
    boats = []
    commanded = {boat.name for boat in _commanded(fleet)}
    for i, boat in enumerate(fleet.boats):
        platform = fleet.platform_of[boat.name]
        driven = boat.agent is not None and boat.name not in commanded
        boats.append(
            SimBoat(
                name=boat.name,
                platform=platform if hulls is None else hulls(boat.name, platform),
                team=fleet.team_of[boat.name],
                system_id=0 if boat.link is None else boat.link.system_id,
                address=None if boat.link is None else boat.link.address,
                policy=opponents if driven else "",
                start=None if boat.agent is not None else _beside(fleet, i),
                gate=boat.link.gate if isinstance(boat.link, MoosLinkSettings) else "helm",
            )
        )
    return boats


def _commanded(fleet: FleetFile) -> list[BoatSettings]:
    """Boats that a runner of the file commands, be it one process or one per boat."""
    ours = [boat for boat in fleet.boats if boat.link is not None and boat.commanded]
    return [boat for boat in ours if fleet.team_of[boat.name] == fleet.team_number]


def _beside(fleet: FleetFile, number: int) -> tuple[float, float, float]:
    """Place of a boat outside the game: along the geofence's lower edge."""
    return fleet.geofence.xmin_m + 2.0 + _APART_M * number, fleet.geofence.ymin_m + 2.0, 90.0


def settings_of(fleet: FleetFile) -> dict[str, Any]:
    """What a file says of a `SimFleet`'s settings.

    Raises:
        FleetFileError: the game's rules cannot be used.
        ConfigError: the signing key cannot be read, or others can read it.
    """
    origin = fleet.field.origin
    settings: dict[str, Any] = {
        "origin": (origin.latitude_deg, origin.longitude_deg),
        "y_axis_deg": fleet.field.y_axis_deg,
        "feed_to": fleet.position_listeners(),
        "separation_m": fleet.shield_config.separation_m,
        "key": None if fleet.signing is None else read_key(fleet.signing.key_file),
    }
    if fleet.agent_ids:
        settings["preset"] = game_config(fleet).replace(dt_s=STEP_S)
    return settings
