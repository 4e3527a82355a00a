"""What the autopilots of own boats remember, where nobody tells: the model is run along with the commands sent.

A heading controller's last error and a boat's thrust decide what the next command does, and no telemetry tells them.
The boats' model, stepped through the command that worked since the last decision, does, for as long as what is seen
agrees with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .jit import Array, BoolArray
from .plan import LARGEST_COMMAND
from .platforms import layout as L
from .platforms.step import step_boat
from .remembering import Stayed
from .tracks import fill_memory

WINDOW_S = 5.0
"""Time constant over which differences between what was predicted and what is seen are summed, s."""

SURPRISE = np.array([25.0, 0.2])
"""Sums of differences (deg, m/s) beyond which a boat did not do what it was told: its memory is not known any more."""

_SEEN = [L.HEADING, L.SPEED]
_ERRORS = [L.SPEED_ERROR, L.HEADING_ERROR]
_OTHER_MEMORY = [L.THRUST, L.RUDDER, L.SPEED_INTEGRAL, L.HEADING_INTEGRAL, L.TURN_RATE]


@dataclass
class Autopilots:
    """Believed states of n own boats one step after the last decision, for the next one alone.

    Attributes:
        row: (n, N_STATE) state; NaN where nothing is believed.
        off: (n, 2) summed differences of heading, deg, and speed, m/s, see `WINDOW_S`.
    """

    row: Array
    off: Array

    @classmethod
    def of(cls, boats: int) -> Autopilots:
        """Nothing known yet of so many boats."""
        return cls(np.full((boats, L.N_STATE), np.nan), np.zeros((boats, 2)))

    def carry_over(self, old: Autopilots, stayed: Stayed) -> None:
        """Take over what was believed of boats that stayed."""
        self.row[stayed.now], self.off[stayed.now] = old.row[stayed.then], old.off[stayed.then]

    def fill(self, state: Array, unknown: BoolArray, dt_s: float) -> None:
        """Write what is believed into the memory of ``unknown`` boats, in place; errors that are given stay.

        Boats that are not where the model has them (`SURPRISE`) are left as they are. Nothing is believed afterwards
        until `go_on`, whatever becomes of the decision.
        """
        row, self.row = self.row, np.full_like(self.row, np.nan)
        apart = state[:, _SEEN] - row[:, _SEEN]
        apart[:, 0] = (apart[:, 0] + 180.0) % 360.0 - 180.0
        self.off = self.off * math.exp(-dt_s / WINDOW_S) + np.nan_to_num(apart)
        lost = (np.abs(self.off) > SURPRISE).any(axis=1)
        self.off[lost] = 0.0
        who = unknown & ~lost & ~np.isnan(row[:, L.THRUST])
        for column in _OTHER_MEMORY:
            state[who, column] = row[who, column]
        for column in _ERRORS:
            missing = who & np.isnan(state[:, column])
            state[missing, column] = row[missing, column]

    def go_on(self, state: Array, unknown: BoolArray, params: Array, commands: Array, dt_s: float) -> None:
        """Run ``unknown`` boats one step on from ``state`` (n, N_STATE); of the others nothing is believed.

        Args:
            state: where they are, with what was believed filled in.
            unknown: (n,) own boats whose memory nobody tells.
            params: (n, N_PARAM) platform rows.
            commands: (n, 2) the command that works in this step, speed m/s and relative heading deg, or NaN.
            dt_s: step, s.
        """
        self.row[:] = state
        fill_memory(self.row, params)
        who = unknown & (np.abs(commands) <= LARGEST_COMMAND).all(axis=1)
        for i in np.flatnonzero(who):
            step_boat(params[i], self.row[i], commands[i, 0], commands[i, 1], dt_s)
        self.row[~who] = np.nan
