"""How long a command takes to work, measured while boats are steered.

The boat's model is run once for every delay it may have; the one that foretells the measured turning best is right.
Only moments in which the models disagree tell anything: a boat that holds its course says nothing about its delay.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from ..config import ShieldConfig
from ..jit import Array
from ..platforms import Platform, fresh_state, step_boat
from ..platforms import layout as L
from ..tracking.tracks import steps_of_delay, thrust_at
from .link import BoatReading, Sent
from .overruns import left_out
from .tick import Action

LONGEST_STEPS = 8
"""Delays up to this many steps are told apart."""

MEMORY_S = 60.0
"""What was measured longer ago than this counts little."""

TELLING_DEG = 0.3
"""Models that foretell headings closer together than this, deg per step, tell nothing."""

LATER_S = 0.15
"""Commands that work later than declared by more than this are told of, s."""

ENOUGH_DEG2 = 30.0
"""Sum of squared disagreement needed before an answer is given, deg^2."""


class DelayMeter:
    """Measures one boat's delay from command to effect.

    Args:
        platform: the boat's.
        dt_s: step of the loop, s.
    """

    def __init__(self, platform: Platform, dt_s: float) -> None:
        self._params = platform.pack()
        self._dt_s = dt_s
        self._rows: Array | None = None
        self._read_s = math.inf
        self._commands: deque[tuple[float, float] | None] = deque([None] * (LONGEST_STEPS + 1), LONGEST_STEPS + 1)
        self._cost = np.zeros(LONGEST_STEPS + 1)
        self._told = 0.0
        self._keep = math.exp(-dt_s / MEMORY_S)

    @property
    def delay_s(self) -> float | None:
        """Delay, s; None while too little was seen to tell."""
        if self._told < ENOUGH_DEG2:
            return None
        best = int(np.argmin(self._cost))
        if not 0 < best < LONGEST_STEPS:
            return best * self._dt_s
        before, here, after = self._cost[best - 1 : best + 2]
        bend = before - 2.0 * here + after
        return float(best + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) * self._dt_s

    def update(self, reading: BoatReading) -> None:
        """Take a reading at a turn of the loop, before this turn's command is sent."""
        self._go_through(left_out(reading.read_s - self._read_s, self._dt_s))
        self._read_s = reading.read_s
        seen = _seen_of(reading)
        if not np.isfinite(seen).all() or reading.age_s > 3.0 * self._dt_s:
            self._rows = None
            return
        if self._rows is None:
            self._rows = np.tile(fresh_state(*seen), (LONGEST_STEPS + 1, 1))
            self._rows[:, L.THRUST] = thrust_at(self._params, seen[3])
            return
        foretold = self._foretell(self._rows)
        missed = (seen[2] - foretold + 180.0) % 360.0 - 180.0
        apart = float(np.ptp(missed))
        if TELLING_DEG < apart < 90.0 and None not in self._commands:
            self._cost = self._keep * self._cost + missed**2
            self._told = self._keep * self._told + apart**2
        self._rows[:, [L.X, L.Y, L.HEADING, L.SPEED]] = seen

    def _go_through(self, turns: int) -> None:
        """Go through turns that were left out: nothing was seen in them, and the last command stayed in force."""
        if turns > LONGEST_STEPS:
            self._rows = None
        for _ in range(min(turns, LONGEST_STEPS + 1)):
            if self._rows is not None:
                self._foretell(self._rows)
            self._commands.append(self._commands[-1])

    def sent(self, heading_rad: float, speed_mps: float) -> None:
        """Note the command sent at this turn."""
        usable = math.isfinite(heading_rad) and math.isfinite(speed_mps)
        self._commands.append((float(np.degrees(heading_rad)), speed_mps) if usable else None)

    def _foretell(self, rows: Array) -> Array:
        """Run each model one step on, with the command that works now if the delay is that model's; headings, deg."""
        for k, row in enumerate(rows):
            command = self._commands[len(self._commands) - 1 - k]
            if command is not None:
                error = (command[0] - row[L.HEADING] + 180.0) % 360.0 - 180.0
                step_boat(self._params, row, command[1], error, self._dt_s)
        return rows[:, L.HEADING].copy()


class Delays:
    """The meters of all boats of a process.

    Args:
        platforms: of each boat, by name.
        config: what the shield counts on.
    """

    def __init__(self, platforms: Mapping[str, Platform], config: ShieldConfig) -> None:
        self._declared_s, self._counted_s = config.delay_s, steps_of_delay(config) * config.dt_s
        self._meters = {name: DelayMeter(platform, config.dt_s) for name, platform in platforms.items()}

    def update(self, readings: Mapping[str, BoatReading], sent: Mapping[str, Sent]) -> None:
        """Take what came in and what left at one turn of the loop."""
        for name, meter in self._meters.items():
            meter.update(readings[name])
            meter.sent(sent[name].heading_rad, sent[name].speed_mps)

    def measured_s(self) -> dict[str, float]:
        """Delay of each boat of which enough was seen, s."""
        found = {name: meter.delay_s for name, meter in self._meters.items()}
        return {name: delay for name, delay in found.items() if delay is not None}

    def actions(self) -> list[Action]:
        """Boats whose commands take longer to work than the shield counts on."""
        return [
            Action(
                name,
                "delay",
                "none",
                f"{name}: commands work after {delay:.1f} s, the shield counts on {self._counted_s:.1f} s; "
                "run preflight again, or set shield.delay_s",
            )
            for name, delay in self.measured_s().items()
            if delay > self._declared_s + LATER_S
        ]


def _seen_of(reading: BoatReading) -> Array:
    """X m, y m, heading deg, speed m/s; the heading run on by its age."""
    turned = reading.turn_rate_rads * reading.heading_age_s if math.isfinite(reading.turn_rate_rads) else 0.0
    heading_deg = (math.degrees(reading.heading_rad + turned) + 180.0) % 360.0 - 180.0
    return np.array([*reading.position_m, heading_deg, reading.speed_mps])
