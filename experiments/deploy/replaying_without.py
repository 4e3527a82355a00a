"""What would have happened without the shield.

As long as the shield changes nothing, boats do what is wanted of them, so that what happened is what would have
happened. When it changes a boat's command, the boat is taken from its recorded place and steered on by what was wanted,
with its platform's model; when nothing was changed for a while it is put back on its recorded track. All others stay on
their recorded tracks: they would have answered differently, and so would the policy, which is why a stretch is not
followed for longer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat
from steerclear.shield.tracking.tracks import whole_steps

from .replaying_tracks import Array, Tracks

BACK_S = 5.0
"""A boat is put back when its command was not changed for so long, s."""
LONGEST_S = 20.0
"""A boat is put back after so long in any case, s."""


@dataclass(frozen=True)
class Without:
    """Tracks without the shield.

    Attributes:
        states: (T+1, n, N_STATE) as in `Tracks`.
        away: (T+1, n) bool, boats that are not on their recorded track.
        stretches: how many times a boat left it.
    """

    states: Array
    away: NDArray[np.bool_]
    stretches: int


def sail_without(tracks: Tracks, delay_s: float = 0.0) -> Without:
    """Steer boats whose command was changed by what was wanted.

    Args:
        tracks: what happened.
        delay_s: from a command to its effect, s.
    """
    states = tracks.states.copy()
    away = np.zeros(states.shape[:2], dtype=np.bool_)
    late = whole_steps(delay_s, tracks.dt_s)
    stretches = sum(_sail(tracks, int(i), late, states, away) for i in np.flatnonzero(tracks.ours))
    return Without(states, away, stretches)


def _sail(tracks: Tracks, i: int, late: int, states: Array, away: NDArray[np.bool_]) -> int:
    """One boat, in place; returns how many times it left its track."""
    back, longest = round(BACK_S / tracks.dt_s), round(LONGEST_S / tracks.dt_s)
    begun = quiet = 0
    out, stretches = False, 0
    for k in range(late, len(tracks.wanted)):
        changed = bool(tracks.intervened[k - late, i])
        quiet = 0 if changed else quiet + 1
        there = np.isfinite(tracks.states[k : k + 2, i, L.X]).all()
        if out and (quiet >= back or k - begun >= longest or not there):
            out = False
        if not out and changed and there:
            out, begun, stretches = True, k, stretches + 1
            states[k, i] = tracks.states[k, i]
        if out:
            states[k + 1, i] = _stepped(tracks, i, states[k, i], tracks.wanted[k - late, i])
            away[k + 1, i] = True
    return stretches


def _stepped(tracks: Tracks, i: int, row: Array, wanted: Array) -> Array:
    """The boat one step on; a command nobody could follow leaves it to stop on its course."""
    row = row.copy()
    speed_mps, heading_rad = (float(value) for value in wanted)
    if not (math.isfinite(speed_mps) and math.isfinite(heading_rad) and abs(speed_mps) < 1e3):
        speed_mps, heading_rad = 0.0, math.radians(row[L.HEADING])
    error_deg = (math.degrees(heading_rad) - row[L.HEADING] + 180.0) % 360.0 - 180.0
    step_boat(tracks.params[i], row, speed_mps, error_deg, tracks.dt_s)
    return row
