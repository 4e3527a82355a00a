"""`ModelErrorMonitor`: prediction errors of the boats' models, measured during a run, and the margins they require.

The monitor compares a boat's position with those that its model predicted 1, 2 and 3 s ago from the commands sent.
A quantile of these errors becomes the boat's model-error margin, within bounds. The errors include every cause: a wrong
model, a delay longer than declared, wind and waves, another commander.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from ..jit import Array, BoolArray
from ..platforms import layout as L
from ..tracks import roll_out_pending, steps_of_delay
from .fleet_file import FleetFile
from .messages import Action, BoatReading, Sent

AHEAD_S = (1.0, 2.0, 3.0)  # prediction horizons, s
TOLD_BY = 1  # index in `AHEAD_S` of the errors that set the margin: a backup is chosen anew long before it ends
SHARE = 0.95  # quantile of the errors that a margin covers
MEMORY_S = 60.0  # time span of the errors remembered, s
ENOUGH_S = 5.0  # least time span of errors before they count, s
WIDEN_MPS = 0.1  # largest rate of change of a margin, m/s: a jump would look like a separation violation
WORTH_TELLING_M = 0.15  # excess of a margin over the declared error beyond which it is reported, m
ROUNDING_M = 0.05
"""Smaller quantiles are rounding of the messages and set no margin: decisions then equal those in the simulator."""
FRESH_S = 0.3  # older positions are no measurement, s
LATE = 0.6  # largest delay of a turn, in steps, that leaves no turn out


class ModelErrorMonitor:
    """Prediction errors of the boats of this process.

    Attributes:
        margin_m: bound on each boat's position error for the shield, m, by boat name.
    """

    def __init__(self, fleet: FleetFile, boats: tuple[str, ...]) -> None:
        config = fleet.shield_config
        self._boats, self._limit, self._dt_s = boats, fleet.limits.model, config.dt_s
        self._steps = [max(1, round(ahead / config.dt_s)) for ahead in AHEAD_S]
        self._late = steps_of_delay(config)
        self._params = np.array([fleet.platform_of[name].pack() for name in boats]).reshape(-1, L.N_PARAM)
        measured = (fleet.measured_of(name).get("position_error_m", 0.0) for name in boats)
        self._declared_m = np.array([max(config.position_error_m, error) for error in measured])
        longest = max(self._steps) + self._late + 1
        self._rows: deque[Array] = deque(maxlen=longest)
        self._commanded: deque[Array] = deque(maxlen=longest)
        self._errors = np.full((round(MEMORY_S / config.dt_s), len(boats), len(AHEAD_S)), np.nan)
        self._number = 0
        self._read_s = math.inf
        self._outside_s = np.zeros(len(boats))
        self.margin_m = {name: float(margin) for name, margin in zip(boats, self._declared_m, strict=True)}

    def update(self, rows: Mapping[str, Array | None], readings: Mapping[str, BoatReading]) -> None:
        """Take in the estimated states (None: unknown), before this turn's decision.

        Skipped turns count as turns without measurement in which the last command stayed in force. So the monitor finds
        a wrong model even in a loop that often falls behind.
        """
        read_s = max((reading.read_s for reading in readings.values()), default=self._read_s)
        gap_s, self._read_s = read_s - self._read_s, read_s
        left_out = math.ceil(gap_s / self._dt_s - 1.0 - LATE) if math.isfinite(gap_s) else 0
        for _ in range(min(left_out, self._rows.maxlen or 0)):
            self._rows.append(np.full((len(self._boats), L.N_STATE), np.nan))
            if self._commanded:
                self._commanded.append(self._commanded[-1])
        now = np.full((len(self._boats), L.N_STATE), np.nan)
        for i, name in enumerate(self._boats):
            row, reading = rows.get(name), readings[name]
            if row is not None and reading.position_age_s <= FRESH_S and reading.ready:
                now[i] = row
        self._rows.append(now)
        errors = self._errors[self._number % len(self._errors)]
        for k, steps in enumerate(self._steps):
            errors[:, k] = self._missed_m(now, steps)
        self._number += 1
        for i, name in enumerate(self._boats):
            if math.isfinite(errors[i, TOLD_BY]):
                change = self._dt_s if errors[i, TOLD_BY] > self._limit.outside_m else -self._dt_s
                self._outside_s[i] = max(0.0, self._outside_s[i] + change)
            step = WIDEN_MPS * self._dt_s
            self.margin_m[name] += min(max(self._goal_m(name) - self.margin_m[name], -step), step)

    def sent(self, sent: Mapping[str, Sent]) -> None:
        """Record the commands sent in this turn."""
        commanded = np.full((len(self._boats), 2), np.nan)
        for i, name in enumerate(self._boats):
            command = sent.get(name)
            if command is not None and command.delivered and math.isfinite(command.heading_rad):
                commanded[i] = command.speed_mps, math.degrees(command.heading_rad)
        self._commanded.append(commanded)

    def _missed_m(self, now: Array, steps: int) -> Array:
        """Return distances from the positions predicted ``steps`` steps ago, m; NaN if unknown."""
        if len(self._rows) <= steps or len(self._commanded) < steps + self._late:
            return np.full(len(self._boats), np.nan)
        then = self._rows[-1 - steps].copy()
        commanded = np.array(
            list(self._commanded)[len(self._commanded) - steps - self._late : len(self._commanded) - self._late]
        )
        known: BoolArray = np.asarray(np.isfinite(then[:, : L.SPEED + 1]).all(axis=1))
        known = np.asarray(known & np.isfinite(commanded).all(axis=(0, 2)))
        roll_out_pending(then, known, self._params, commanded, self._dt_s)
        missed = np.hypot(then[:, L.X] - now[:, L.X], then[:, L.Y] - now[:, L.Y])
        return np.where(known, missed, np.nan)

    def _goal_m(self, name: str) -> float:
        """Return the margin that a boat's errors require, m, within its bounds."""
        missed_m = self.quantile_m(name)
        missed_m = missed_m if missed_m > ROUNDING_M else 0.0
        return max(float(self._declared_m[self._boats.index(name)]), min(missed_m, self._limit.widest_m))

    def quantile_m(self, boat: str, ahead: int = TOLD_BY, share: float = SHARE) -> float:
        """Return a quantile of a boat's errors, m; ``ahead`` is an index in `AHEAD_S`; 0 with too few errors."""
        errors = self._errors[:, self._boats.index(boat), ahead]
        errors = errors[np.isfinite(errors)]
        if len(errors) < ENOUGH_S / self._dt_s:
            return 0.0
        place = int(share * (len(errors) - 1))
        return float(np.partition(errors, place)[place])

    def latest_m(self, boat: str) -> tuple[float, ...]:
        """Return a boat's prediction errors of this turn for each of `AHEAD_S`, m; NaN if unknown."""
        row = self._errors[(self._number - 1) % len(self._errors), self._boats.index(boat)]
        return tuple(row.tolist())

    def outside_s(self, boat: str) -> float:
        """Return how long a boat's error has exceeded ``limits.model.outside_m``, s; time below it counts back."""
        return float(self._outside_s[self._boats.index(boat)])

    def actions(self) -> list[Action]:
        """Return an action for each boat with a widened margin, with its prediction errors."""
        found = []
        for name, declared in zip(self._boats, self._declared_m, strict=True):
            margin, goal = self.margin_m[name], self._goal_m(name)
            if margin <= declared + WORTH_TELLING_M:
                continue
            missed = "/".join(f"{self.quantile_m(name, k):.1f}" for k in range(len(AHEAD_S)))
            growing = f", growing to {goal:.2f} m" if goal > margin + 0.005 else ""
            is_bounded = self.quantile_m(name) > self._limit.widest_m >= goal
            bound = ", the most that limits.model.widest_m allows" if is_bounded else ""
            text = f"{name}: its model misses {missed} m 1/2/3 s ahead (95 of 100); "
            text += f"model-error margin {margin:.2f} m{growing}{bound}; if it stays so, steerclear fit this run's log"
            found.append(Action(name, "tracking", "none", text))
        return found
