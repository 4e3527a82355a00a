"""Simulated boats from a FLEET.yaml, the very file that the runner reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from steerclear.experiments.deploy.rules import game_config
from steerclear.shield.bridge.fleet_file import FleetFile, load_fleet
from steerclear.shield.bridge.mavlink.signing import read_key

from .hull import STEP_S
from .settings import SimBoat


def as_fleet(fleet: FleetFile | str | Path) -> FleetFile:
    """A fleet file, read when a path is given.

    Raises:
        FleetFileError: it cannot be used.
    """
    return fleet if isinstance(fleet, FleetFile) else load_fleet(fleet)


def boats_of(fleet: FleetFile, opponents: str) -> list[SimBoat]:
    """The boats of a file; those of the game that have no link are driven by ``opponents``."""
    boats = []
    for boat in fleet.boats:
        driven = boat.link is None and boat.agent is not None
        boats.append(
            SimBoat(
                name=boat.name,
                platform=fleet.platform_of[boat.name],
                team=fleet.team_of[boat.name],
                system_id=0 if boat.link is None else boat.link.system_id,
                address=None if boat.link is None else boat.link.address,
                policy=opponents if driven else "",
            )
        )
    return boats


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
