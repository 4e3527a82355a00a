"""A hull in the water: its orders, the platform's own dynamics, and what they leave out (astern, hard stops, drift).

While a boat is told heading and speed ahead and the water is still, a step is `step_boat` and nothing else, so that a
boat here and a boat of the simulator stay the same bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform, fresh_state, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate
from steerclear.shield.platforms.usv import advance_hull, wrap_degrees

from .settings import Water


@dataclass(frozen=True)
class Steer:
    """Hold a heading (rad clockwise from the field's y axis) at a speed over ground, m/s, negative astern."""

    heading_rad: float
    speed_mps: float


@dataclass(frozen=True)
class Bear:
    """Turn by an angle (deg, clockwise) from the present heading at a speed, m/s, as the game's own boats are told."""

    error_deg: float
    speed_mps: float


@dataclass(frozen=True)
class Turn:
    """Turn at a rate (rad/s, clockwise) at a speed over ground, m/s, negative astern."""

    rate_rads: float
    speed_mps: float


@dataclass(frozen=True)
class Keep:
    """Stop and stay.

    Attributes:
        back_up_m: run astern once stopped.
    """

    back_up_m: float = 0.0


@dataclass(frozen=True)
class Actuate:
    """Rudder and thrust themselves, percent; only thrust ahead."""

    rudder: float
    thrust: float


@dataclass(frozen=True)
class Coast:
    """Motors off."""


Order = Steer | Bear | Turn | Keep | Actuate | Coast


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


_BACK_UP_PER_S = 0.17
"""Speed of backing up per metre still to go: with 2 m it begins at the measured 0.34 m/s."""
_BACK_UP_ENDS_M = 0.1
_RETURN_BEYOND_M = 3.0
_RETURN_SPEED_MPS = 0.5
_RETURNED_M = 1.0


class Helmsman:
    """Moves one hull.

    Args:
        hull: the hull.
    """

    def __init__(self, hull: Hull) -> None:
        self.hull = hull
        self._station: tuple[float, float] | None = None
        self._back_up_m: float | None = None
        self._returning = False

    def step(self, order: Order) -> None:
        """Advance the hull by one step under an order."""
        if not isinstance(order, Keep):
            self._station = self._back_up_m = None
        if isinstance(order, Steer):
            self.hull.steer(order.heading_rad, order.speed_mps)
        elif isinstance(order, Bear):
            self.hull.bear(order.error_deg, order.speed_mps)
        elif isinstance(order, Turn):
            self.hull.turn(order.rate_rads, order.speed_mps)
        elif isinstance(order, Keep):
            self._keep(order)
        elif isinstance(order, Actuate):
            self.hull.drive(order.rudder, order.thrust)
        else:
            self.hull.coast()

    def _keep(self, order: Keep) -> None:
        if self._station is not None:
            self._stay()
        elif self._back_up_m is not None:
            self._back_up()
        elif self.hull.state[L.SPEED] > AT_REST_MPS:
            self.hull.stop()
        else:
            self._back_up_m = order.back_up_m
            self.hull.creep(0.0)

    def _back_up(self) -> None:
        to_go = self._back_up_m or 0.0
        if to_go <= _BACK_UP_ENDS_M:
            self.hull.creep(0.0)
            self._station, self._returning = self._place(), False
            return
        speed = _BACK_UP_PER_S * to_go
        self.hull.creep(-speed)
        self._back_up_m = to_go - speed * self.hull.dt_s

    def _stay(self) -> None:
        station = self._station or self._place()
        off = math.dist(station, self._place())
        self._returning = off > (_RETURNED_M if self._returning else _RETURN_BEYOND_M)
        if self._returning:
            x, y = self._place()
            self.hull.steer(math.atan2(station[0] - x, station[1] - y), _RETURN_SPEED_MPS)
        else:
            self.hull.stop()

    def _place(self) -> tuple[float, float]:
        return float(self.hull.state[L.X]), float(self.hull.state[L.Y])


_GUST_S = 5.0
"""Gusts forget themselves over this time."""


class Weather:
    """The drift of all boats, gusts included.

    Args:
        water: wind and current.
        frame: where the field is.
        random: random numbers of the gusts.
    """

    def __init__(self, water: Water, frame: FieldFrame, random: np.random.Generator) -> None:
        self._water = water
        self._random = random
        self._gust = 0.0
        wind, current = math.radians(water.wind_from_deg + 180.0), math.radians(water.current_to_deg)
        self._leeway = frame.turn_to_field(math.sin(wind), math.cos(wind))
        self._set = frame.turn_to_field(water.current_mps * math.sin(current), water.current_mps * math.cos(current))

    def drift_mps(self, dt_s: float) -> tuple[float, float]:
        """Velocity it gives a boat along the field's axes for the next step, m/s."""
        water = self._water
        if water.is_still:
            return 0.0, 0.0
        kept = math.exp(-dt_s / _GUST_S)
        self._gust = kept * self._gust + math.sqrt(1.0 - kept * kept) * float(self._random.standard_normal())
        push = water.leeway_share * water.wind_mps * max(0.0, 1.0 + water.gust_share * self._gust)
        return self._leeway[0] * push + self._set[0], self._leeway[1] * push + self._set[1]
