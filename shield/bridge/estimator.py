"""State estimation of own boats, including the memory of their autopilots' controllers.

Telemetry does not contain the controllers' memory, on which the effect of the next command depends. The estimator steps
the boat's model through the commands in effect. It corrects the model by each measurement at the time it was taken.
While telemetry agrees with the model, the state is the model's, bit for bit.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ..jit import Array
from ..platforms import Platform, fresh_state, step_boat
from ..platforms import layout as L
from ..tracks import thrust_at, whole_steps
from .messages import BoatReading

GAIN = 0.5  # share of a difference corrected per reading: a time constant of about 0.15 s at 10 Hz
ROUNDING = np.array([0.01, 0.01, 0.02, 0.01])
"""Differences up to this (m, m, deg, m/s) are rounding of the messages and are not corrected."""
SURPRISE = np.array([1.5, 1.5, 25.0, 0.6])
"""Beyond these differences (m, m, deg, m/s) the boat did not follow the model: the estimate restarts at the reading."""
BOAT_TIMEOUT_S = 3.0  # without new commands a boat continues its last one for this long, then stops
SPENT_S = 1.0
"""A command not repeated for this long no longer counts: another steers, and the boat is taken to go straight on."""
LONGEST_GAP_STEPS = 50
"""Most steps taken at once, after the loop stood still; beyond that the state waits for telemetry."""
GONE_M, LEFT_M, STILL_MPS = 0.3, 0.05, 0.1
"""A source that repeats its values exactly while the model moves by the first is frozen, m.

It counts as frozen from when the model had moved by the second, m. Slower than the third, m/s, a boat is at rest."""
MOST_UNSEEN_M = 2.0
"""A boat at rest after possible unseen motion is trusted again only up to this length of that motion, m."""
RATE_AGE_S, RATE_ROUNDING_DPS, RATE_GAIN = 0.15, 2.0, 0.3
"""Largest age of a turn rate used, s; differences up to the second, deg/s, are ignored; gain for larger ones."""
_SEEN = [L.X, L.Y, L.HEADING, L.SPEED]


@dataclass(frozen=True)
class Estimate:
    """Estimated state of an own boat."""

    row: Array  # (N_STATE,) state and autopilot memory
    age_s: float  # age of the oldest measurement used, s
    spread_m: float  # half the distance between its positions with and without the last commands received, m


class Estimator:
    """State estimator of one boat, in steps of ``dt_s``.

    The delay from sending a command to its effect is rounded up to whole steps, as in the shield. With a shorter delay
    the estimator and the shield would both apply the same command.

    Attributes:
        still_since_s: time when the source froze, s; inf if it did not.
        unseen_m: possible motion while the source repeated its values, m; 0 again once a value changes.
    """

    def __init__(self, platform: Platform, dt_s: float, delay_s: float) -> None:
        self._params = platform.pack()
        self._dt_s, self._delay_s = dt_s, whole_steps(delay_s, dt_s) * dt_s
        self._turns_by_rate = self._params[L.KIND] == L.KIND_RATE
        self._row: Array | None = None
        self._deaf: Array | None = None
        self._last_heard: tuple[float, float] | None = None
        self._alone: Array | None = None
        self._same, self._new_s = tuple[float, ...](), -math.inf
        self.still_since_s, self._left_s, self.unseen_m = math.inf, math.inf, 0.0
        self._time_s = -math.inf
        self._fixed_s = np.full(len(_SEEN), -math.inf)
        self._commands: deque[tuple[float, float, float]] = deque(maxlen=64)
        self._past: deque[tuple[float, Array]] = deque(maxlen=32)

    def estimate(self, now_s: float) -> Estimate | None:
        """Return the boat at the time of the last `advance`; None before the first fix."""
        if self._row is None or self._deaf is None:
            return None
        apart = self._deaf[: L.Y + 1] - self._row[: L.Y + 1]
        return Estimate(self._row.copy(), now_s - float(self._fixed_s.min()), 0.5 * float(np.hypot(*apart)))

    def sent(self, tick_s: float, heading_rad: float, speed_mps: float) -> None:
        """Record a command sent at the tick of that time; a heading of NaN means the present heading."""
        if math.isnan(heading_rad):
            if self._row is None:
                return
            heading_rad = math.radians(self._row[L.HEADING])
        self._commands.append((tick_s, speed_mps, heading_rad))

    def advance(self, now_s: float) -> None:
        """Step the model to ``now_s``, in whole steps."""
        if self._row is None or self._deaf is None:
            return
        steps = round((now_s - self._time_s) / self._dt_s)
        for _ in range(min(steps, LONGEST_GAP_STEPS)):
            self._step(self._row, self._in_effect(self._time_s))
            self._step(self._deaf, self._unheard(self._time_s))
            if self._alone is not None:
                self._step(self._alone, self._in_effect(self._time_s))
            self._time_s += self._dt_s
        if steps > 0 or now_s < self._time_s:
            self._time_s = now_s
        self._past.append((now_s, self._row[_SEEN]))

    def correct(self, reading: BoatReading) -> None:
        """Correct the state by a complete reading that passed the plausibility check."""
        fixed_s = _times(reading)
        known = self._row is not None
        difference = self._difference(_measured(reading), fixed_s) if known else np.zeros(len(_SEEN))
        difference[fixed_s <= self._fixed_s + 1e-6] = 0.0
        if self._row is None or (np.abs(difference) > SURPRISE).any():
            self.start(reading)
            return
        difference[np.abs(difference) <= ROUNDING] = 0.0
        if difference.any():
            self._shift(GAIN * difference)
        self._correct_rate(reading)
        self._fixed_s = np.maximum(self._fixed_s, fixed_s)
        self._deaf, self._last_heard = self._row.copy(), self._in_effect(self._time_s)

    def stands_still(self, reading: BoatReading) -> bool:
        """Whether a reading repeats an older one although the boat must have moved since, even with fresh time stamps.

        A boat at rest may repeat its values exactly for any time. Only the commands tell that from a frozen source: an
        uncorrected model, started where the values were new, moves away as the boat would. Once that model is at rest
        under a stop command or none, the boat is taken to be no farther off than the model moved. The source is then
        trusted again, with that distance added to its error.
        """
        measured, fixed_s = _measured(reading), reading.read_s - reading.age_s
        if tuple(measured.tolist()) != self._same or not reading.ready:  # not under our command
            self._same, self._new_s, self.unseen_m = tuple(measured.tolist()), fixed_s, 0.0
            self._alone = fresh_state(*measured)
            self._alone[L.THRUST] = thrust_at(self._params, float(measured[3]))
            self.still_since_s = self._left_s = math.inf
        elif self._alone is not None and fixed_s > self._new_s + 1e-3:
            command = self._in_effect(self._time_s)
            gone_m = float(np.hypot(*(self._alone[: L.Y + 1] - measured[: L.Y + 1])))
            if gone_m > LEFT_M:
                self._left_s = min(self._left_s, reading.read_s)
            if gone_m > GONE_M:
                self.still_since_s = self._left_s
            rests = max(abs(self._alone[L.SPEED]), abs(measured[3])) < STILL_MPS
            if rests and (command is None or command[0] == 0.0) and self.unseen_m + gone_m <= MOST_UNSEEN_M:
                self.unseen_m += gone_m
                self._alone[: L.Y + 1], self._new_s = measured[: L.Y + 1], fixed_s
                self.still_since_s = self._left_s = math.inf
        return math.isfinite(self.still_since_s)

    def _correct_rate(self, reading: BoatReading) -> None:
        """Correct the turn rate of a rate-controlled boat, the only memory of its steering, towards telemetry."""
        if self._row is None or not self._turns_by_rate or not reading.turn_rate_age_s <= RATE_AGE_S:
            return
        off = math.degrees(reading.turn_rate_rads) - self._row[L.TURN_RATE]
        if abs(off) > RATE_ROUNDING_DPS:
            self._row[L.TURN_RATE] += RATE_GAIN * off

    def start(self, reading: BoatReading) -> None:
        """Restart at the reading, assuming steady course and speed."""
        x, y, heading_deg, speed = _measured(reading)
        way, heading = speed * (reading.read_s - float(_times(reading)[0])), math.radians(heading_deg)
        row = fresh_state(x + way * math.sin(heading), y + way * math.cos(heading), heading_deg, speed)
        row[L.THRUST] = thrust_at(self._params, speed)
        if self._turns_by_rate and math.isfinite(reading.turn_rate_rads):
            row[L.TURN_RATE] = math.degrees(reading.turn_rate_rads)
        self._row, self._deaf = row, row.copy()
        self._fixed_s, self._time_s = _times(reading), reading.read_s
        self._last_heard = self._in_effect(self._time_s)
        self._past.clear()
        self._past.append((reading.read_s, row[_SEEN]))

    def _step(self, row: Array, command: tuple[float, float] | None) -> None:
        if command is None:
            way = row[L.SPEED] * self._dt_s
            row[L.X] += way * math.sin(math.radians(row[L.HEADING]))
            row[L.Y] += way * math.cos(math.radians(row[L.HEADING]))
            return
        error = (command[1] - row[L.HEADING] + 180.0) % 360.0 - 180.0
        step_boat(self._params, row, command[0], error, self._dt_s)

    def _in_effect(self, time_s: float) -> tuple[float, float] | None:
        """Return speed, m/s, and heading, deg, of the command in effect in the step after ``time_s``."""
        for sent_s, speed, heading in reversed(self._commands):
            if sent_s + self._delay_s <= time_s + 0.5 * self._dt_s:
                spent = time_s - sent_s - self._delay_s > SPENT_S
                return None if spent else (speed, float(np.degrees(heading)))
        return None

    def _unheard(self, time_s: float) -> tuple[float, float] | None:
        """Return the command in effect if the boat received none since its last fix."""
        silent = time_s - float(self._fixed_s.min())
        if silent <= BOAT_TIMEOUT_S or self._last_heard is None:
            return self._last_heard
        return 0.0, self._last_heard[1]

    def _difference(self, measured: Array, fixed_s: Array) -> Array:
        """Return measured minus estimated values, each at its time of measurement."""
        times, rows = np.array([time for time, _ in self._past]), np.array([row for _, row in self._past])
        rows[:, 2] = np.unwrap(rows[:, 2], period=360.0)
        believed = [np.interp(at_s, times, column) for at_s, column in zip(fixed_s, rows.T, strict=True)]
        difference = measured - np.array(believed)
        difference[2] = (difference[2] + 180.0) % 360.0 - 180.0
        return difference

    def _shift(self, by: Array) -> None:
        """Correct the state, its history and the controllers' last errors, for which the boat used true values."""
        row = self._row
        if row is None:
            return
        row[_SEEN] += by
        row[L.HEADING] = (row[L.HEADING] + 180.0) % 360.0 - 180.0
        row[L.HEADING_ERROR] -= by[2]
        row[L.SPEED_ERROR] -= by[3]
        for _, past in self._past:
            past += by


def _measured(reading: BoatReading) -> Array:
    """Return x m, y m, heading deg in [-180, 180), speed m/s."""
    heading_deg = (math.degrees(reading.heading_rad) + 180.0) % 360.0 - 180.0
    return np.array([*reading.position_m, heading_deg, reading.speed_mps])


def _times(reading: BoatReading) -> Array:
    """Return the measurement time of each value of `_measured`, s."""
    ages = (reading.position_age_s, reading.position_age_s, reading.heading_age_s, reading.velocity_age_s)
    return reading.read_s - np.array(ages)
