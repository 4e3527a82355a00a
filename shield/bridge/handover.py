"""The end of a run: when boats can be handed over, and what is said of those that come near them then.

A boat in HOLD is defended by nobody: the shield goes on with boats told to stop until no other is on the way to
one of them, or the time for that is over.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..platforms import layout as L
from .fleet_file import FleetFile
from .link import BoatReading
from .roster import Roster, Track

REST_MPS = 0.2
"""A boat slower than this lies still, m/s."""


def at_rest(readings: Mapping[str, BoatReading]) -> bool:
    """Whether every own boat that obeys lies still."""
    return all(not reading.ready or abs(reading.speed_mps) < REST_MPS for reading in readings.values())


def nearing(fleet: FleetFile, roster: Roster, readings: Mapping[str, BoatReading]) -> list[str]:
    """Boats that come within the separation radius of one of ours within ``end.clear_s``, a line each.

    Both are run straight on, their errors added; one not heard of for too long is not told. A boat of ours that does
    not obey, because a pilot steers it, may come near the others as any boat may.
    """
    tracks = {name: roster.track(name) for name in fleet.names}
    obeys = {name for name in roster.commanded if name not in readings or readings[name].ready}
    return [
        text
        for name in roster.commanded
        for other in fleet.names
        if other != name and other not in obeys
        for track in (tracks[other], *roster.ghosts(other))
        for text in _told(fleet, (name, tracks[name]), (other, track))
    ]


def _told(fleet: FleetFile, own: tuple[str, Track | None], other: tuple[str, Track | None]) -> list[str]:
    ours, seen = own[1], other[1]
    if ours is None or seen is None or seen.age_s > fleet.limits.contact.lost_after_s:
        return []
    apart, closing = _place(seen) - _place(ours), _velocity(seen) - _velocity(ours)
    if float(np.hypot(*closing)) < REST_MPS:
        return []
    soonest = -float(apart @ closing) / float(closing @ closing)
    time_s = min(max(soonest, 0.0), fleet.end.clear_s)
    near_m = float(np.hypot(*(apart + time_s * closing)))
    if near_m > fleet.shield_config.separation_m + ours.error_m + seen.error_m:
        return []
    return [f"{other[0]} comes within {near_m:.1f} m of {own[0]} in {time_s:.0f} s"]


def _place(track: Track) -> np.ndarray:
    return np.asarray(track.row[: L.Y + 1] + track.ahead_s * _velocity(track))


def _velocity(track: Track) -> np.ndarray:
    heading = np.radians(track.row[L.HEADING])
    return np.asarray(track.row[L.SPEED] * np.array([np.sin(heading), np.cos(heading)]))
