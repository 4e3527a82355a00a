"""`ModelErrorMonitor`: what the boats' models miss, measured while they are steered, and the margins it gives them.

The place that a boat is seen at now is compared with the one its model predicted 1, 2 and 3 s ago under the commands
that were really sent since. Quantiles of these errors become the boat's margin, within bounds: a model that is off, a
delay longer than declared, wind and waves, a boat that obeys somebody else all show there, whatever the cause.
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

AHEAD_S = (1.0, 2.0, 3.0)  # how long ago what is compared was predicted, s
TOLD_BY = 1
"""Place in `AHEAD_S` of the errors that make the margin: a backup is chosen anew long before it is carried out."""
SHARE = 0.95  # quantile of the errors that a margin covers
MEMORY_S = 60.0  # errors are remembered for so long, s
ENOUGH_S = 5.0  # errors of at least so long are needed before they count, s
WIDEN_MPS = 0.1  # a margin changes no faster, m/s: a jump of it would look like a breach
WORTH_TELLING_M = 0.15  # margins beyond what was declared by more than this are told
ROUNDING_M = 0.05
"""Errors up to this are what messages round off: a boat that is its model is decided for as in the simulator."""
FRESH_S = 0.3  # places older than this are no measurement, s
LATE = 0.6  # part of a step that a turn may begin late by and still count as in its place


class ModelErrorMonitor:
    """Follows the boats of a process.

    Attributes:
        margin_m: bound on the error of each boat's place that the shield is to count on, m.
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
        self._told: deque[Array] = deque(maxlen=longest)
        self._errors = np.full((round(MEMORY_S / config.dt_s), len(boats), len(AHEAD_S)), np.nan)
        self._number = 0
        self._read_s = math.inf
        self._outside_s = np.zeros(len(boats))
        self.margin_m = {name: float(margin) for name, margin in zip(boats, self._declared_m, strict=True)}

    def update(self, rows: Mapping[str, Array | None], readings: Mapping[str, BoatReading]) -> None:
        """Take the boats as they are believed to be now (None: not known), before this turn's decision.

        Turns that were left out count, too: nothing was seen in them, and the command before them stayed in force. So a
        loop that often falls behind still finds out a model that is wrong.
        """
        read_s = max((reading.read_s for reading in readings.values()), default=self._read_s)
        gap_s, self._read_s = read_s - self._read_s, read_s
        left_out = math.ceil(gap_s / self._dt_s - 1.0 - LATE) if math.isfinite(gap_s) else 0
        for _ in range(min(left_out, self._rows.maxlen or 0)):
            self._rows.append(np.full((len(self._boats), L.N_STATE), np.nan))
            if self._told:
                self._told.append(self._told[-1])
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
        """Note what left at this turn."""
        told = np.full((len(self._boats), 2), np.nan)
        for i, name in enumerate(self._boats):
            command = sent.get(name)
            if command is not None and command.delivered and math.isfinite(command.heading_rad):
                told[i] = command.speed_mps, math.degrees(command.heading_rad)
        self._told.append(told)

    def _missed_m(self, now: Array, steps: int) -> Array:
        """Distances between boats now and where they were predicted so many steps ago, m; NaN: no telling."""
        if len(self._rows) <= steps or len(self._told) < steps + self._late:
            return np.full(len(self._boats), np.nan)
        then = self._rows[-1 - steps].copy()
        told = np.array(list(self._told)[len(self._told) - steps - self._late : len(self._told) - self._late])
        known: BoolArray = np.asarray(np.isfinite(then[:, : L.SPEED + 1]).all(axis=1))
        known = np.asarray(known & np.isfinite(told).all(axis=(0, 2)))
        roll_out_pending(then, known, self._params, told, self._dt_s)
        missed = np.hypot(then[:, L.X] - now[:, L.X], then[:, L.Y] - now[:, L.Y])
        return np.where(known, missed, np.nan)

    def _goal_m(self, name: str) -> float:
        """Margin that a boat's errors ask for, m, within its bounds."""
        missed_m = self.quantile_m(name)
        missed_m = missed_m if missed_m > ROUNDING_M else 0.0
        return max(float(self._declared_m[self._boats.index(name)]), min(missed_m, self._limit.widest_m))

    def quantile_m(self, boat: str, ahead: int = TOLD_BY, share: float = SHARE) -> float:
        """Quantile of a boat's errors so far ahead (place in `AHEAD_S`), m; 0 while too little was seen."""
        errors = self._errors[:, self._boats.index(boat), ahead]
        errors = errors[np.isfinite(errors)]
        if len(errors) < ENOUGH_S / self._dt_s:
            return 0.0
        place = int(share * (len(errors) - 1))
        return float(np.partition(errors, place)[place])

    def latest_m(self, boat: str) -> tuple[float, ...]:
        """How far a boat is at this turn from where it was predicted, for each of `AHEAD_S`, m; NaN: no telling."""
        row = self._errors[(self._number - 1) % len(self._errors), self._boats.index(boat)]
        return tuple(row.tolist())

    def outside_s(self, boat: str) -> float:
        """How long a boat has been far outside its model, s."""
        return float(self._outside_s[self._boats.index(boat)])

    def actions(self) -> list[Action]:
        """Boats whose margin was widened, with what their model misses."""
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
