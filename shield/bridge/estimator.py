"""Own boats: what the autopilot remembers is followed by running the boat's model on the commands sent.

Telemetry says where a boat is, never what its controllers remember, and what they remember decides what the next
command does. The model is stepped through the commands in effect and corrected by telemetry, measurement by
measurement at the time each was true. As long as telemetry agrees with the model the row is the model's, bit for bit.
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

GAIN = 0.5  # share of a difference that is corrected at once: a filter of about 0.15 s at 10 Hz
ROUNDING = np.array([0.01, 0.01, 0.02, 0.01])
"""Differences below this (m, m, deg, m/s) are what messages round off, and are left alone."""
SURPRISE = np.array([1.5, 1.5, 25.0, 0.6])
"""Differences beyond this (m, m, deg, m/s) say that the boat did not obey the model: it starts afresh there."""
BOAT_TIMEOUT_S = 3.0  # a boat that hears nothing goes on with its last command for this long, then stops
SPENT_S = 1.0
"""A command not repeated for this long says nothing any more: somebody else steers, and the boat goes straight on."""
LONGEST_GAP_STEPS = 50
"""Steps run at once at most, after a standstill of the loop; beyond it the row waits for telemetry."""
GONE_M, LEFT_M, STILL_MPS = 0.3, 0.05, 0.1
"""A source that repeats itself to the last digit while the model goes the first is frozen, since it left by the second.
Slower than the third a boat lies still."""
MOST_UNSEEN_M = 2.0
"""A boat found at rest again after it may have gone unseen is believed anew until that way is longer than this, m."""
RATE_AGE_S, RATE_ROUNDING_DPS, RATE_GAIN = 0.15, 2.0, 0.3
"""Turn rates told are taken when no older, s; smaller differences, deg/s, are left alone; of larger ones this share."""
_SEEN = [L.X, L.Y, L.HEADING, L.SPEED]


@dataclass(frozen=True)
class Estimate:
    """A boat of ours now."""

    row: Array  # (N_STATE,) state and autopilot memory
    age_s: float  # since the oldest of what it rests on was measured, s
    spread_m: float  # half the distance between where it is if it heard the last commands and if it did not, m


class Estimator:
    """Follows one boat, in steps of ``dt_s`` of the loop and the model.

    The delay from sending a command to its effect is counted up to whole steps, as the shield counts it: with less a
    command would be run here and by the shield once more.

    Attributes:
        still_since_s: when its source froze, s; inf: it did not.
        unseen_m: way it may have gone while its source repeated itself, m; counts until something changes.
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
        """The boat at the time of the last `advance`; None before the first fix."""
        if self._row is None or self._deaf is None:
            return None
        apart = self._deaf[: L.Y + 1] - self._row[: L.Y + 1]
        return Estimate(self._row.copy(), now_s - float(self._fixed_s.min()), 0.5 * float(np.hypot(*apart)))

    def sent(self, tick_s: float, heading_rad: float, speed_mps: float) -> None:
        """Note a command that left at the tick of that time; a heading of NaN is the present one."""
        if math.isnan(heading_rad):
            if self._row is None:
                return
            heading_rad = math.radians(self._row[L.HEADING])
        self._commands.append((tick_s, speed_mps, heading_rad))

    def advance(self, now_s: float) -> None:
        """Run the model on to ``now_s``, in whole steps."""
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
        """Take a reading, already found sensible, whose fields are all there."""
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
        """Whether a reading repeats an older one although the boat must have moved since, whatever its time stamps say.

        At rest a boat may say the same to the last digit for ever. Only commands tell that from a source that froze:
        the model starts where the values were new, is never corrected, and leaves them as the boat would. Told to stop
        for that, it comes to rest; then the boat lies where the source has it, or no farther off than the model went,
        and is believed anew with that much more error.
        """
        measured, fixed_s = _measured(reading), reading.read_s - reading.age_s
        if tuple(measured.tolist()) != self._same or not reading.ready:  # who has a boat by hand moves it as he likes
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
        """Bring the turn rate of a rate-controlled boat, all that its steering remembers, nearer to telemetry."""
        if self._row is None or not self._turns_by_rate or not reading.turn_rate_age_s <= RATE_AGE_S:
            return
        off = math.degrees(reading.turn_rate_rads) - self._row[L.TURN_RATE]
        if abs(off) > RATE_ROUNDING_DPS:
            self._row[L.TURN_RATE] += RATE_GAIN * off

    def start(self, reading: BoatReading) -> None:
        """Begin afresh where the reading says: the boat is taken to hold its course and speed."""
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
        """Speed, m/s, and heading, deg, of the command that works in the step after ``time_s``."""
        for sent_s, speed, heading in reversed(self._commands):
            if sent_s + self._delay_s <= time_s + 0.5 * self._dt_s:
                spent = time_s - sent_s - self._delay_s > SPENT_S
                return None if spent else (speed, float(np.degrees(heading)))
        return None

    def _unheard(self, time_s: float) -> tuple[float, float] | None:
        """The command in effect if the boat heard nothing since its last fix."""
        silent = time_s - float(self._fixed_s.min())
        if silent <= BOAT_TIMEOUT_S or self._last_heard is None:
            return self._last_heard
        return 0.0, self._last_heard[1]

    def _difference(self, measured: Array, fixed_s: Array) -> Array:
        """Measured less believed, each at the time it was measured."""
        times, rows = np.array([time for time, _ in self._past]), np.array([row for _, row in self._past])
        rows[:, 2] = np.unwrap(rows[:, 2], period=360.0)
        believed = [np.interp(at_s, times, column) for at_s, column in zip(fixed_s, rows.T, strict=True)]
        difference = measured - np.array(believed)
        difference[2] = (difference[2] + 180.0) % 360.0 - 180.0
        return difference

    def _shift(self, by: Array) -> None:
        """Correct the row, what led up to it, and the errors the controllers saw: they saw the true ones."""
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
    """X m, y m, heading deg in [-180, 180), speed m/s."""
    heading_deg = (math.degrees(reading.heading_rad) + 180.0) % 360.0 - 180.0
    return np.array([*reading.position_m, heading_deg, reading.speed_mps])


def _times(reading: BoatReading) -> Array:
    """When each of them was true, s."""
    ages = (reading.position_age_s, reading.position_age_s, reading.heading_age_s, reading.velocity_age_s)
    return reading.read_s - np.array(ages)
