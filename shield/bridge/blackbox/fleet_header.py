"""The header of a log, from a fleet file."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from ..fleet_file import FleetFile
from .header import LoggedBoat, LogHeader


def header_of_fleet(
    fleet: FleetFile,
    text: str,
    *,
    policy: str,
    commanded: Collection[str],
    clock_s: float,
    notes: Mapping[str, str] | None = None,
) -> LogHeader:
    """What a log of a fleet must begin with.

    Args:
        fleet: the file.
        text: its text, word for word.
        policy: name of the policy.
        commanded: names of the boats this process commands.
        clock_s: time on the loop's clock now, s.
        notes: anything else worth keeping.
    """
    boats = tuple(
        LoggedBoat(
            name=boat.name,
            agent=boat.agent or "",
            team=fleet.team_of[boat.name],
            platform=fleet.platform_of[boat.name].name,
            ours=boat.name in commanded,
        )
        for boat in fleet.boats
    )
    return LogHeader(
        config=fleet.shield_config,
        surroundings=fleet.surroundings,
        platforms={kind.name: kind for kind in fleet.platform_of.values()},
        boats=boats,
        frame=fleet.frame,
        field_size_m=fleet.field.size_m,
        fleet_text=text,
        preset=fleet.preset,
        policy=policy,
        notes={} if notes is None else notes,
        clock_s=clock_s,
    )
