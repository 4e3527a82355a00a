"""A hull in the water: the platform's own dynamics, and what they leave out (astern, hard stops, wind and current).

While a boat is told heading and speed ahead and the water is still, a step is `step_boat` and nothing else, so that a
boat here and a boat of the simulator stay the same bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform, fresh_state, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate
from steerclear.shield.platforms.usv import advance_hull, wrap_degrees

STEP_S = 0.1
"""Step for which the platforms are defined, s."""

AT_REST_MPS = 0.05
"""Below this a boat may change over between ahead and astern, m/s."""


@dataclass
class Hull:
    """One boat in the water; each of its moves takes one step.

    Attributes:
        state: row (N_STATE,) of `shield.platforms.layout`; the heading is the bow's, the speed that of the way it runs.
        params: the platform's row.
        brake_mps2: deceleration of a hard stop; None: the platform's own.
        dt_s: step, s.
        astern: whether it runs astern.
        drift_mps: velocity of wind and current along the field's x and y axes, m/s.
        turn_rate_rads: of the last step, clockwise.
    """

    state: Array
    params: Array
    brake_mps2: float | None = None
    dt_s: float = STEP_S
    astern: bool = False
    drift_mps: tuple[float, float] = (0.0, 0.0)
    turn_rate_rads: float = 0.0

    @classmethod
    def at(
        cls, platform: Platform, x_m: float, y_m: float, heading_deg: float, brake_mps2: float | None = None
    ) -> Hull:
        """A boat at rest at a place of the field."""
        return cls(fresh_state(x_m, y_m, heading_deg), platform.pack(), brake_mps2)

    def warm_up(self) -> None:
        """Compile the dynamics now, so that the first step takes no longer than the others."""
        for move in (step_boat, actuate):
            move(self.params, self.state.copy(), 1.0, 1.0, self.dt_s)

    @property
    def heading_rad(self) -> float:
        """Of the bow, rad clockwise from the field's y axis."""
        return math.radians(float(self.state[L.HEADING]))

    @property
    def speed_mps(self) -> float:
        """Along the bow through the water, negative astern, m/s."""
        return float(-self.state[L.SPEED] if self.astern else self.state[L.SPEED])

    @property
    def velocity_mps(self) -> tuple[float, float]:
        """Over ground along the field's axes, m/s."""
        speed, heading = self.speed_mps, self.heading_rad
        return speed * math.sin(heading) + self.drift_mps[0], speed * math.cos(heading) + self.drift_mps[1]

    def error_deg(self, heading_rad: float) -> float:
        """Heading error, deg in [-180, 180), as the autopilot is given it."""
        return (math.degrees(heading_rad) - float(self.state[L.HEADING]) + 180.0) % 360.0 - 180.0

    def steer(self, heading_rad: float, speed_mps: float) -> None:
        """Hold a heading at a speed over ground, m/s, negative astern."""
        self.bear(self.error_deg(heading_rad), speed_mps)

    def bear(self, error_deg: float, speed_mps: float) -> None:
        """Turn by an angle from the present heading at a speed over ground, m/s, negative astern."""
        speed = self._through_water(speed_mps)
        self._run(speed, lambda: step_boat(self.params, self.state, abs(speed), error_deg, self.dt_s))

    def turn(self, rate_rads: float, speed_mps: float) -> None:
        """Turn at a rate, rad/s, at a speed over ground, m/s, as far as the actuators allow."""
        speed = self._through_water(speed_mps)
        turn_deg = math.degrees(rate_rads) * self.dt_s
        self._run(speed, lambda: actuate(self.params, self.state, abs(speed), turn_deg, self.dt_s))

    def drive(self, rudder: float, thrust: float) -> None:
        """Move a thrust boat under rudder and thrust, percent, within the platform's limits."""
        limit, most = min(float(self.params[L.MAX_RUDDER]), 100.0), float(self.params[L.MAX_THRUST])
        self.state[L.RUDDER] = min(max(rudder, -limit), limit)
        self.state[L.THRUST] = min(max(thrust, 0.0), most)
        self._move(lambda: advance_hull(self.params, self.state, self.dt_s))

    def stop(self) -> None:
        """Take the way off hard, heading kept."""
        if self.brake_mps2 is None:
            self._move(lambda: step_boat(self.params, self.state, 0.0, 0.0, self.dt_s))
            return
        old = float(self.state[L.SPEED])
        new = max(0.0, old - self.brake_mps2 * self.dt_s)
        self._shift(0.5 * (old + new))
        self.forget()
        self.state[L.SPEED] = new
        self._finish(float(self.state[L.HEADING]))

    def coast(self) -> None:
        """Motors off."""
        self.state[L.THRUST] = 0.0
        self._move(lambda: step_boat(self.params, self.state, 0.0, 0.0, self.dt_s))

    def creep(self, speed_mps: float) -> None:
        """Move at a low speed along the bow, negative astern, without regard to the dynamics."""
        self.astern = speed_mps < 0.0
        self.forget()
        self.state[L.SPEED] = abs(speed_mps)
        self._shift(abs(speed_mps))
        self._finish(float(self.state[L.HEADING]))

    def forget(self) -> None:
        """Clear what the controllers remember, as a restart does."""
        self.state[[L.THRUST, L.RUDDER, L.SPEED_INTEGRAL, L.HEADING_INTEGRAL, L.TURN_RATE]] = 0.0
        self.state[[L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan

    def _through_water(self, speed_mps: float) -> float:
        """Speed to ask of the hull so that it makes good ``speed_mps`` over ground along its bow."""
        if self.drift_mps == (0.0, 0.0) or speed_mps == 0.0:
            return speed_mps
        heading = self.heading_rad
        wanted = speed_mps - self.drift_mps[0] * math.sin(heading) - self.drift_mps[1] * math.cos(heading)
        return max(wanted, 0.0) if speed_mps > 0.0 else min(wanted, 0.0)

    def _run(self, speed_mps: float, move: Callable[[], None]) -> None:
        """Move ahead or astern as the speed's sign says; from one to the other only through rest."""
        change = (speed_mps < 0.0) != self.astern and speed_mps != 0.0
        if change and self.state[L.SPEED] > AT_REST_MPS:
            self.stop()
            return
        if change:
            self.astern = not self.astern
            self.forget()
        self._move(move)

    def _move(self, move: Callable[[], None]) -> None:
        """One step of the dynamics; astern it is the same hull turned round."""
        before = float(self.state[L.HEADING])
        if self.astern:
            self.state[L.HEADING] = wrap_degrees(before + 180.0)
            move()
            self.state[L.HEADING] = wrap_degrees(float(self.state[L.HEADING]) + 180.0)
        else:
            move()
        self._finish(before)

    def _shift(self, speed_mps: float) -> None:
        """Move straight along the way it runs."""
        way = (-speed_mps if self.astern else speed_mps) * self.dt_s
        self.state[L.X] += math.sin(self.heading_rad) * way
        self.state[L.Y] += math.cos(self.heading_rad) * way

    def _finish(self, heading_before_deg: float) -> None:
        if self.drift_mps != (0.0, 0.0):
            self.state[L.X] += self.drift_mps[0] * self.dt_s
            self.state[L.Y] += self.drift_mps[1] * self.dt_s
        turned = wrap_degrees(float(self.state[L.HEADING]) - heading_before_deg)
        self.turn_rate_rads = math.radians(turned) / self.dt_s
