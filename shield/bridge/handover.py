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


def nearing(fleet: FleetFile, roster: Roster) -> list[str]:
    """Boats that come within the separation radius of one of ours within ``end.clear_s``, a line each.

    Both are run straight on, their errors added; a contact too old to be known is not told.
    """
    own = {name: roster.track(name) for name in roster.commanded}
    others = {
        name: roster.track(name)
        for name in fleet.names
        if name not in own and roster.contact_age_s(name) <= fleet.limits.contact.lost_after_s
    }
    return [
        text
        for name, track in own.items()
        for other, seen in others.items()
        if track is not None and seen is not None
        for text in _told(fleet, (name, track), (other, seen))
    ]


def _told(fleet: FleetFile, own: tuple[str, Track], other: tuple[str, Track]) -> list[str]:
    apart, closing = _place(other[1]) - _place(own[1]), _velocity(other[1]) - _velocity(own[1])
    if float(np.hypot(*closing)) < REST_MPS:
        return []
    soonest = -float(apart @ closing) / float(closing @ closing)
    time_s = min(max(soonest, 0.0), fleet.end.clear_s)
    near_m = float(np.hypot(*(apart + time_s * closing)))
    if near_m > fleet.shield_config.separation_m + own[1].error_m + other[1].error_m:
        return []
    return [f"{other[0]} comes within {near_m:.1f} m of {own[0]} in {time_s:.0f} s"]


def _place(track: Track) -> np.ndarray:
    return np.asarray(track.row[: L.Y + 1] + track.ahead_s * _velocity(track))


def _velocity(track: Track) -> np.ndarray:
    heading = np.radians(track.row[L.HEADING])
    return np.asarray(track.row[L.SPEED] * np.array([np.sin(heading), np.cos(heading)]))
