"""The checks before a start, gathered: the links', the situation's, the log's."""

from __future__ import annotations

from steerclear.shield.bridge.blackbox import check_disk
from steerclear.shield.bridge.preflight.result import Check
from steerclear.shield.bridge.roster import Roster
from steerclear.shield.bridge.situation import situation_checks

from .station import Station

LOOK_S = 1.5
"""How long boats are looked at before their situation is judged, s."""


def look(station: Station, seconds: float = LOOK_S) -> Roster:
    """Watch all boats for a while; what is known of them then."""
    fleet, clock = station.fleet, station.clock
    roster = Roster(fleet, station.links)
    end = clock.now_s() + seconds
    while True:
        now = clock.now_s()
        readings = {name: link.read() for name, link in station.links.items()}
        roster.update(now, readings, station.contacts())
        if now >= end:
            return roster
        clock.sleep_until(now + fleet.dt_s)


def checks_of(station: Station, minutes: float) -> list[Check]:
    """Checks that move no boat, in the order to run.

    Args:
        station: connected.
        minutes: how long the run may take.
    """
    fleet = station.fleet
    roster = look(station)
    disk = Check("disk", lambda: check_disk(fleet.log_dir, boats=len(fleet.boats), minutes=minutes))
    return [disk, *situation_checks(fleet, roster)]
