"""A hull in the water: its orders, the platform's own dynamics, and what they leave out (astern, hard stops, drift).

While a boat is told heading and speed ahead and the water is still, a step is `step_boat` and nothing else, so that a
boat here and a boat of the simulator stay the same bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.platforms import Platform, fresh_state, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate
from steerclear.shield.platforms.usv import advance_hull, wrap_degrees

from .settings import Water

STEP_S = 0.1  # step for which the platforms are defined, s
AT_REST_MPS = 0.05  # below this a boat may change over between ahead and astern, m/s
_BACK_UP_PER_S = 0.17  # speed of backing up per metre still to go: with 2 m it begins at the measured 0.34 m/s
_BACK_UP_ENDS_M, _RETURN_BEYOND_M, _RETURNED_M, _RETURN_SPEED_MPS = 0.1, 3.0, 1.0, 0.5
_GUST_S = 5.0  # gusts forget themselves over this time


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
    """Turn at a rate (rad/s, clockwise) at a speed over ground, m/s, as far as the actuators allow."""

    rate_rads: float
    speed_mps: float


@dataclass(frozen=True)
class Keep:
    """Stop, run astern by ``back_up_m`` once stopped, and stay."""

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


class Hull:
    """One boat in the water.

    Args:
        platform: what it is.
        x_m, y_m, heading_deg: where it lies at rest.
        brake_mps2: deceleration of a hard stop; None: the platform's own.

    Attributes:
        state: row (N_STATE,) of `shield.platforms.layout`; the heading is the bow's, the speed that of the way it runs.
        params: the platform's row.
        astern: whether it runs astern.
        drift_mps: velocity of wind and current along the field's x and y axes, m/s.
        turn_rate_rads: of the last step, clockwise.
    """

    def __init__(
        self, platform: Platform, x_m: float, y_m: float, heading_deg: float, brake_mps2: float | None = None
    ) -> None:
        self.state, self.params = fresh_state(x_m, y_m, heading_deg), platform.pack()
        self.astern, self.drift_mps, self.turn_rate_rads = False, (0.0, 0.0), 0.0
        self._brake_mps2 = brake_mps2
        self._station: tuple[float, float] | None = None
        self._back_up_m: float | None = None
        self._returning = False

    def warm_up(self) -> None:
        """Compile the dynamics now, so that the first step takes no longer than the others."""
        for move in (step_boat, actuate):
            move(self.params, self.state.copy(), 1.0, 1.0, STEP_S)

    def place(self, x_m: float, y_m: float, heading_deg: float, speed_mps: float) -> None:
        """Put it somewhere, its controllers cleared."""
        self.forget()
        self.astern, self._station, self._back_up_m = False, None, None
        self.state[[L.X, L.Y, L.HEADING, L.SPEED]] = x_m, y_m, heading_deg, speed_mps

    def forget(self) -> None:
        """Clear what the controllers remember, as a restart does."""
        self.state[[L.THRUST, L.RUDDER, L.SPEED_INTEGRAL, L.HEADING_INTEGRAL, L.TURN_RATE]] = 0.0
        self.state[[L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan

    @property
    def position_m(self) -> tuple[float, float]:
        """In the field, m."""
        return float(self.state[L.X]), float(self.state[L.Y])

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

    def obey(self, order: Order) -> None:
        """Advance by one step under an order."""
        before = float(self.state[L.HEADING])
        if not isinstance(order, Keep):
            self._station = self._back_up_m = None
        match order:
            case Steer(heading_rad, speed_mps):
                self._steer(heading_rad, speed_mps)
            case Bear(error_deg, speed_mps):
                self._run(speed_mps, step_boat, error_deg)
            case Turn(rate_rads, speed_mps):
                self._run(speed_mps, actuate, math.degrees(rate_rads) * STEP_S)
            case Actuate(rudder, thrust):
                limit = min(float(self.params[L.MAX_RUDDER]), 100.0)
                self.state[L.RUDDER] = min(max(rudder, -limit), limit)
                self.state[L.THRUST] = min(max(thrust, 0.0), float(self.params[L.MAX_THRUST]))
                self._move(advance_hull)
            case Keep(back_up_m):
                self._keep(back_up_m)
            case Coast():
                self.state[L.THRUST] = 0.0
                self._move(step_boat, 0.0, 0.0)
        self.state[L.X] += self.drift_mps[0] * STEP_S
        self.state[L.Y] += self.drift_mps[1] * STEP_S
        self.turn_rate_rads = math.radians(wrap_degrees(float(self.state[L.HEADING]) - before)) / STEP_S

    def _steer(self, heading_rad: float, speed_mps: float) -> None:
        error = (math.degrees(heading_rad) - float(self.state[L.HEADING]) + 180.0) % 360.0 - 180.0
        self._run(speed_mps, step_boat, error)

    def _run(self, speed_mps: float, move: Callable[..., None], turn_deg: float) -> None:
        """Make good a speed over ground ahead or astern; from one to the other only through rest."""
        if self.drift_mps != (0.0, 0.0) and speed_mps != 0.0:
            x, y = self.drift_mps
            through = speed_mps - x * math.sin(self.heading_rad) - y * math.cos(self.heading_rad)
            speed_mps = max(through, 0.0) if speed_mps > 0.0 else min(through, 0.0)
        if (speed_mps < 0.0) != self.astern and speed_mps != 0.0:
            if self.state[L.SPEED] > AT_REST_MPS:
                self._stop()
                return
            self.astern = not self.astern
            self.forget()
        self._move(move, abs(speed_mps), turn_deg)

    def _move(self, move: Callable[..., None], *command: Any) -> None:
        """One step of the dynamics; astern it is the same hull turned round."""
        turned = 180.0 if self.astern else 0.0
        if turned:
            self.state[L.HEADING] = wrap_degrees(float(self.state[L.HEADING]) + turned)
        move(self.params, self.state, *command, STEP_S)
        if turned:
            self.state[L.HEADING] = wrap_degrees(float(self.state[L.HEADING]) + turned)

    def _stop(self) -> None:
        """Take the way off hard, heading kept."""
        if self._brake_mps2 is None:
            self._move(step_boat, 0.0, 0.0)
        else:
            old = float(self.state[L.SPEED])
            new = max(0.0, old - self._brake_mps2 * STEP_S)
            self._slide(0.5 * (old + new), new)

    def _slide(self, mean_mps: float, speed_mps: float) -> None:
        """Move along the bow at a mean speed without regard to the dynamics, to run at a speed then."""
        way = (-mean_mps if self.astern else mean_mps) * STEP_S
        self.state[L.X] += math.sin(self.heading_rad) * way
        self.state[L.Y] += math.cos(self.heading_rad) * way
        self.forget()
        self.state[L.SPEED] = speed_mps

    def _keep(self, back_up_m: float) -> None:
        """Stop, back up, and from then on return to that place when set off too far."""
        if self._station is not None:
            off = math.dist(self._station, self.position_m)
            self._returning = off > (_RETURNED_M if self._returning else _RETURN_BEYOND_M)
            if self._returning:
                x, y = self.position_m
                self._steer(math.atan2(self._station[0] - x, self._station[1] - y), _RETURN_SPEED_MPS)
            else:
                self._stop()
        elif self._back_up_m is None and self.state[L.SPEED] > AT_REST_MPS:
            self._stop()
        else:
            self._back_up(back_up_m)

    def _back_up(self, back_up_m: float) -> None:
        speed = 0.0
        if self._back_up_m is None:
            self._back_up_m = back_up_m
        elif self._back_up_m <= _BACK_UP_ENDS_M:
            self._station, self._returning = self.position_m, False
        else:
            speed = _BACK_UP_PER_S * self._back_up_m
            self._back_up_m -= speed * STEP_S
        self.astern = speed > 0.0
        self._slide(speed, speed)


class Weather:
    """The drift of all boats, gusts included."""

    def __init__(self, water: Water, frame: FieldFrame, random: np.random.Generator) -> None:
        self._water, self._random, self._gust = water, random, 0.0
        wind, current = math.radians(water.wind_from_deg + 180.0), math.radians(water.current_to_deg)
        self._leeway = frame.turn_to_field(math.sin(wind), math.cos(wind))
        self._set = frame.turn_to_field(water.current_mps * math.sin(current), water.current_mps * math.cos(current))

    def drift_mps(self) -> tuple[float, float]:
        """Velocity it gives a boat along the field's axes for the next step, m/s."""
        water = self._water
        if water.is_still:
            return 0.0, 0.0
        kept = math.exp(-STEP_S / _GUST_S)
        self._gust = kept * self._gust + math.sqrt(1.0 - kept * kept) * float(self._random.standard_normal())
        push = water.leeway_share * water.wind_mps * max(0.0, 1.0 + water.gust_share * self._gust)
        return self._leeway[0] * push + self._set[0], self._leeway[1] * push + self._set[1]
