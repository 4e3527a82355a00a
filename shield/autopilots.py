"""What the autopilots of own boats remember, where nobody tells: the model is run along with the commands sent.

A heading controller's last error and a boat's thrust decide what the next command does, and no telemetry tells them.
The boats' model, stepped through the command that worked since the last decision, does, for as long as it predicts what
is seen better than the same step without that memory: another autopilot than the model's is soon found out.

It counts most where decisions are seldom: of three herons that decide once a second and tell their places, headings and
speeds alone, 12 of 60 runs come half a metre too near without it, none with it.
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
"""Time constant over which differences between what was predicted and what is seen are summed, s."""

SURPRISE = np.array([25.0, 0.2])
"""Sums of differences (deg, m/s) beyond which a boat did not do what it was told: its memory is not known any more."""

JUMP_M = 1.5
"""A boat so far from where it was predicted, m, and what its position may be off, was not steered by what was sent."""

NO_WORSE = np.array([1e-3, 1e-5])
"""Differences of such sums (deg, m/s) that are rounding."""

_SEEN = [L.HEADING, L.SPEED]
_HEADING, _SPEED = range(2)
_MEMORY = (
    (_HEADING, L.HEADING_ERROR, (L.HEADING_ERROR, L.HEADING_INTEGRAL, L.RUDDER)),
    (_HEADING, L.TURN_RATE, (L.TURN_RATE,)),
    (_SPEED, L.THRUST, (L.THRUST,)),
    (_SPEED, L.SPEED_ERROR, (L.SPEED_ERROR, L.SPEED_INTEGRAL)),
)
"""Which sum of differences judges what: a column that says whether it is told, and those that go with it."""


@kernel
def all_known(state: Array) -> bool:
    """Whether no memory of any boat is unknown: the quick answer, which simulators' states give at every step."""
    for i in range(state.shape[0]):
        for column in range(L.THRUST, L.HEADING_ERROR + 1):
            if math.isnan(state[i, column]):
                return False
    return True


def unknown_memory(state: Array) -> BoolArray:
    """Boats, (n,), of whose autopilots something that counts is not told."""
    return np.asarray(np.isnan(state[:, [L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]]).any(axis=1))


def to_turn(commands: Array, state: Array) -> Array:
    """Commands (n, 2) of speed m/s and absolute heading deg as relative ones; others' may be anything."""
    with np.errstate(invalid="ignore"):
        turn = (commands[:, 1] - state[:, L.HEADING] + 180.0) % 360.0 - 180.0
    return np.stack([commands[:, 0], turn], axis=1)


@dataclass
class Autopilots:
    """Two predictions of n own boats one step after the last decision: with the memory believed, and without any.

    Attributes:
        start: (2, n, N_STATE) states they were made from.
        after: (2, n, N_STATE) states predicted; NaN where there is no prediction.
        off: (n, 2) summed differences of heading, deg, and speed, m/s, of the first, see `WINDOW_S`.
        wrong: (2, n, 2) sums of the amounts of both.
    """

    start: Array
    after: Array
    off: Array
    wrong: Array

    @classmethod
    def of(cls, boats: int) -> Autopilots:
        """Nothing known yet of so many boats."""
        nothing = np.full((2, boats, L.N_STATE), np.nan)
        return cls(nothing, nothing.copy(), np.zeros((boats, 2)), np.zeros((2, boats, 2)))

    def carry_over(self, old: Autopilots, now: IntArray, then: IntArray) -> None:
        """Take over what was believed of boats that stayed, by their places now and then."""
        self.after[:, now], self.off[now], self.wrong[:, now] = old.after[:, then], old.off[then], old.wrong[:, then]

    def fill(self, state: Array, unknown: BoolArray, dt_s: float, error_m: float = 0.0) -> None:
        """Write what is believed into the memory of ``unknown`` boats, in place, where it is not told.

        Boats that are not where the model has them are left as they are, and so is the part of the memory, that of the
        heading or that of the speed, with which the model predicts worse than without. Nothing is believed afterwards
        until `go_on`, whatever becomes of the decision.

        Args:
            state: (n, N_STATE) what is seen and told.
            unknown: (n,) own boats whose memory is not told, see `unknown_memory`.
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
        """Run ``unknown`` boats one step on from where they were at `fill`; of the others nothing is believed.

        Args:
            unknown: (n,) own boats whose memory is not told.
            params: (n, N_PARAM) platform rows.
            commands: (n, 2) the command that works in this step, speed m/s and relative heading deg, or NaN.
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
    """Write memory into states, in place, where it is not told, for the parts of ``who`` (n, 2): heading and speed."""
    for part, sign, columns in _MEMORY:
        missing = who[:, part] & ~_known(sign, state)
        for column in columns:
            state[missing, column] = believed[missing, column]


def _known(sign: int, state: Array) -> BoolArray:
    """Boats, (n,), of which that column is told; a turn rate of 0 is what fleets say that know none."""
    column = state[:, sign]
    return np.asarray(~np.isnan(column) & ((sign != L.TURN_RATE) | (column != 0.0)))


def _apart(state: Array, after: Array) -> Array:
    """Differences of heading, deg, and speed, m/s, (2, n, 2), from two predictions; 0 where there is none."""
    apart = state[:, _SEEN] - after[:, :, _SEEN]
    apart[:, :, 0] = (apart[:, :, 0] + 180.0) % 360.0 - 180.0
    return np.nan_to_num(apart)
