"""Estimate of own autopilots' memory where it is not reported: the model is stepped with the commands sent.

A heading controller's last error and a boat's thrust decide the effect of the next command, but telemetry does not
report them. The boat's model, stepped through the command in effect since the last decision, estimates them. The
estimate is used as long as it predicts what is seen better than the same step without that memory; so an autopilot
unlike the model's is soon found out.

It matters most where decisions are rare. Of three herons that decide once a second and report only position, heading
and speed, 12 of 60 runs come half a metre too near without it, and none with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .jit import Array, BoolArray, IntArray, kernel
from .platforms import layout as L
from .platforms.step import step_boat
from .tracks import fill_memory
from .workspace import LARGEST_COMMAND

WINDOW_S = 5.0
"""Time constant of the sums of differences between prediction and observation, s."""

SURPRISE = np.array([25.0, 0.2])
"""Sums of differences (deg, m/s) beyond which a boat did not follow its command: its memory is unknown again."""

JUMP_M = 1.5
"""A boat so far from its prediction, m, beyond position errors, was not steered by the command sent."""

NO_WORSE = np.array([1e-3, 1e-5])
"""Differences of such sums (deg, m/s) that count as rounding."""

_SEEN = [L.HEADING, L.SPEED]
_HEADING, _SPEED = range(2)
_MEMORY = (
    (_HEADING, L.HEADING_ERROR, (L.HEADING_ERROR, L.HEADING_INTEGRAL, L.RUDDER)),
    (_HEADING, L.TURN_RATE, (L.TURN_RATE,)),
    (_SPEED, L.THRUST, (L.THRUST,)),
    (_SPEED, L.SPEED_ERROR, (L.SPEED_ERROR, L.SPEED_INTEGRAL)),
)
"""Which sum of differences judges which columns: a column that shows whether they are reported, then all of them."""


@kernel
def all_known(state: Array) -> bool:
    """Return whether no boat's memory is unknown: the quick answer, true for simulators' states at every step."""
    for i in range(state.shape[0]):
        for column in range(L.THRUST, L.HEADING_ERROR + 1):
            if math.isnan(state[i, column]):
                return False
    return True


def unknown_memory(state: Array) -> BoolArray:
    """Return the boats, (n,), whose autopilot memory is not fully reported."""
    return np.asarray(np.isnan(state[:, [L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]]).any(axis=1))


def to_turn(commands: Array, state: Array) -> Array:
    """Return commands (n, 2) of speed m/s and absolute heading deg as relative ones; other boats' may be anything."""
    with np.errstate(invalid="ignore"):
        turn = (commands[:, 1] - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
    return np.stack([commands[:, 0], turn], axis=1)


@dataclass
class Autopilots:
    """Two predictions of n own boats one step after the last decision: with the estimated memory, and without any.

    Attributes:
        start: (2, n, N_STATE) states from which they were made.
        after: (2, n, N_STATE) predicted states; NaN where there is no prediction.
        off: (n, 2) summed differences of heading, deg, and speed, m/s, of the first, see `WINDOW_S`.
        wrong: (2, n, 2) summed absolute differences of both.
    """

    start: Array
    after: Array
    off: Array
    wrong: Array

    @classmethod
    def of(cls, boats: int) -> Autopilots:
        """Return estimates of so many boats, all unknown."""
        nothing = np.full((2, boats, L.N_STATE), np.nan)
        return cls(nothing, nothing.copy(), np.zeros((boats, 2)), np.zeros((2, boats, 2)))

    def carry_over(self, old: Autopilots, now: IntArray, then: IntArray) -> None:
        """Take over the estimates of boats that stayed, by their places now and then."""
        self.after[:, now], self.off[now], self.wrong[:, now] = old.after[:, then], old.off[then], old.wrong[:, then]

    def fill(self, state: Array, unknown: BoolArray, dt_s: float, error_m: float = 0.0) -> None:
        """Write the estimate into the memory of ``unknown`` boats, in place, where it is not reported.

        Boats that are not where the model has them are left unchanged. So is the part of the memory (heading or speed)
        with which the model predicts worse than without. Afterwards nothing is estimated until `go_on`, whatever
        becomes of the decision.

        Args:
            state: (n, N_STATE) observed and reported state.
            unknown: (n,) own boats whose memory is not reported, see `unknown_memory`.
            dt_s: time since the last decision, s.
            error_m: bound on the error of positions, m.
        """
        after, self.after = self.after, np.full_like(self.after, np.nan)
        fade, apart = math.exp(-dt_s / WINDOW_S), _apart(state, after)
        self.off = self.off * fade + apart[0]
        self.wrong = self.wrong * fade + np.abs(apart)
        gap_m = np.hypot(state[:, L.X] - after[0, :, L.X], state[:, L.Y] - after[0, :, L.Y])
        lost = (np.abs(self.off) > SURPRISE).any(axis=1) | (gap_m > JUMP_M + 2.0 * error_m)
        self.off[lost] = 0.0
        known = unknown & ~lost & np.isfinite(after[0, :, L.X])
        better = self.wrong[0] <= self.wrong[1] + NO_WORSE
        self.start = np.stack([state, state])
        _write(after[0], known[:, None] & np.array([True, True]), self.start[0])
        _write(after[0], known[:, None] & better, state)

    def go_on(self, unknown: BoolArray, params: Array, commands: Array, dt_s: float) -> None:
        """Predict ``unknown`` boats one step ahead from where they were at `fill`; of others nothing is estimated.

        Args:
            unknown: (n,) own boats whose memory is not reported.
            params: (n, N_PARAM) platform rows.
            commands: (n, 2) the command in effect in this step, speed m/s and relative heading deg, or NaN.
            dt_s: step, s.
        """
        who = unknown & (np.abs(commands) <= LARGEST_COMMAND).all(axis=1)
        for rows, start in zip(self.after, self.start, strict=True):
            rows[:] = start
            fill_memory(rows, params)
            for i in np.flatnonzero(who):
                step_boat(params[i], rows[i], commands[i, 0], commands[i, 1], dt_s)
            rows[~who] = np.nan


def _write(believed: Array, who: BoolArray, state: Array) -> None:
    """Write unreported memory into states, in place, for the parts of ``who`` (n, 2): heading and speed."""
    for part, sign, columns in _MEMORY:
        missing = who[:, part] & ~_known(sign, state)
        for column in columns:
            state[missing, column] = believed[missing, column]


def _known(sign: int, state: Array) -> BoolArray:
    """Return the boats, (n,), that report that column; a turn rate of 0 counts as not reported."""
    column = state[:, sign]
    return np.asarray(~np.isnan(column) & ((sign != L.TURN_RATE) | (column != 0.0)))


def _apart(state: Array, after: Array) -> Array:
    """Return differences of heading, deg, and speed, m/s, (2, n, 2), from two predictions; 0 where there is none."""
    apart = state[:, _SEEN] - after[:, :, _SEEN]
    apart[:, :, 0] = (apart[:, :, 0] + 180.0) % 360.0 - 180.0
    return np.nan_to_num(apart)
