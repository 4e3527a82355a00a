"""The fleet the shield is given: every boat ever seen, in the file's order, with ages and errors."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ..fleet import Fleet
from ..jit import Array
from ..platforms import layout as L
from .fleet_file import FleetFile
from .roster import Roster, Track

GHOST = "~"
"""Names of ghosts are the boat's name, this and a number; no boat of a fleet file has it in its name."""

SEEN_COLUMNS = [L.X, L.Y, L.HEADING, L.SPEED]


def assemble(roster: Roster, controlled: Collection[str], without: Collection[str] = ()) -> Fleet | None:
    """The fleet now.

    The order is the file's, so that the shield's memory survives what comes and goes; boats never seen are left out. A
    track is run on by its age up to ``contact.lost_after_s`` and its error grows until then; a ghost that grew for ever
    would in the end drive our boats off the water.

    Args:
        roster: what is known.
        controlled: boats to decide for.
        without: boats to leave out.

    Returns:
        The fleet, or None when no boat is known.

    Raises:
        FleetError: what is known makes no fleet.
    """
    tracks = {name: roster.track(name) for name in roster.fleet.names if name not in without}
    known = {name: track for name, track in tracks.items() if track is not None}
    if not known:
        return None
    ghosts = {f"{name}{GHOST}{k}": track for name in known for k, track in enumerate(roster.ghosts(name), start=2)}
    fleet = _fleet(roster.fleet, known | ghosts, controlled)
    fleet.check()
    return fleet


def _fleet(file: FleetFile, known: Mapping[str, Track], controlled: Collection[str]) -> Fleet:
    names = tuple(known)
    boats = [name.partition(GHOST)[0] for name in names]
    longest = file.limits.contact.lost_after_s
    growth = file.shield_config.track_error_mps
    tracks = known.values()
    errors = [track.error_m + growth * (min(track.age_s, longest) - min(track.ahead_s, longest)) for track in tracks]
    return Fleet(
        state=np.array([track.row for track in tracks]),
        team=np.array([file.team_of[boat] for boat in boats], dtype=np.int64),
        platforms=tuple(file.kind_of[boat] for boat in boats),
        controlled=np.array([name in controlled for name in names], dtype=np.bool_),
        names=names,
        age_s=np.array([min(track.ahead_s, longest) for track in tracks]),
        position_error_m=np.array(errors),
    )


def seen_now(roster: Roster) -> Array:
    """(n, 4) of all boats of the file: x m, y m, heading deg, speed m/s, run on to now; NaN where never seen."""
    seen = np.full((len(roster.fleet.names), 4), np.nan)
    for i, name in enumerate(roster.fleet.names):
        track = roster.track(name)
        if track is not None:
            ahead = min(track.ahead_s, roster.fleet.limits.contact.lost_after_s)
            heading = np.radians(track.row[L.HEADING])
            seen[i] = track.row[SEEN_COLUMNS]
            seen[i, :2] += track.row[L.SPEED] * ahead * np.array([np.sin(heading), np.cos(heading)])
    return seen
