"""The checks before a start, gathered: the log's, the links', the situation's, the drill's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, partial

from steerclear.shield.bridge.autopilot_fence import check_fence
from steerclear.shield.bridge.blackbox import check_disk
from steerclear.shield.bridge.link_checks import link_checks
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from steerclear.shield.bridge.moos.checks import moos_checks
from steerclear.shield.bridge.moos.vehicle import MoosLink
from steerclear.shield.bridge.preflight_checks import SITUATION, Check, check_situation
from steerclear.shield.bridge.session import VehicleSession
from steerclear.shield.bridge.tracker import Tracker

from .grounds import grounds_of
from .preflight_file import check_drill

LOOK_S = 1.5
"""How long boats are looked at before their situation is judged, s."""


class _Look:
    """What is known of all boats after watching them for a while, when first asked for."""

    def __init__(self, station: VehicleSession) -> None:
        self._station = station

    @cached_property
    def roster(self) -> Tracker:
        station = self._station
        fleet, clock = station.fleet, station.clock
        roster = Tracker(fleet, station.links)
        due = clock.now_s()
        for _ in range(math.ceil(LOOK_S / fleet.dt_s)):
            due += fleet.dt_s
            clock.sleep_until(due)
            readings = {name: link.read() for name, link in station.links.items()}
            roster.update(clock.now_s(), readings, station.contacts())
        return roster


def checks_of(station: VehicleSession, minutes: float) -> list[Check]:
    """Checks that move no boat, in the order to run.

    Args:
        station: connected.
        minutes: how long the run may take.
    """
    fleet, look = station.fleet, _Look(station)
    disk = Check("disk", lambda: check_disk(fleet.log_dir, boats=len(fleet.boats), minutes=minutes))
    mavlink = {name: link for name, link in station.links.items() if isinstance(link, MavlinkLink)}
    moos = {name: link for name, link in station.links.items() if isinstance(link, MoosLink)}
    fences = [Check(f"fence:{name}", partial(check_fence, name, fleet, link)) for name, link in mavlink.items()]
    links = [*link_checks(mavlink, fleet.platform_of, station.clock), *fences, *moos_checks(moos, fleet)]
    grounds = grounds_of(fleet)
    situation = [
        Check(name, lambda name=name: check_situation(name, fleet, look.roster, grounds)) for name in SITUATION
    ]
    return [disk, *links, *situation]


def drilled_check(station: VehicleSession, text: str, boat: str | None, accept: Sequence[str]) -> Check:
    """The check that these boats were drilled lately, and did well but for what is accepted."""
    return Check("drill", lambda: check_drill(station.fleet, text, boat, tuple(station.links), accept))
