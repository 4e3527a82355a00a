"""Turns an autopilot's order into the hull's moves, among them stopping, backing up and staying at a place."""

from __future__ import annotations

import math

from steerclear.shield.platforms import layout as L

from .hull import AT_REST_MPS, Hull
from .orders import Actuate, Bear, Keep, Order, Reach, Steer, Turn

_BACK_UP_PER_S = 0.17
"""Speed of backing up per metre still to go: with 2 m it begins at the measured 0.34 m/s."""
_BACK_UP_ENDS_M = 0.1
_RETURN_BEYOND_M = 3.0
_RETURN_SPEED_MPS = 0.5
_REACHED_M = 2.0


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
        elif isinstance(order, Reach):
            self._go_to((order.x_m, order.y_m), order.speed_mps, _REACHED_M)
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
        self._returning = off > (_REACHED_M / 2.0 if self._returning else _RETURN_BEYOND_M)
        if self._returning:
            self._go_to(station, _RETURN_SPEED_MPS, 0.0)
        else:
            self.hull.stop()

    def _go_to(self, place: tuple[float, float], speed_mps: float, radius_m: float) -> None:
        x, y = self._place()
        if math.dist(place, (x, y)) <= radius_m:
            self.hull.stop()
        else:
            self.hull.steer(math.atan2(place[0] - x, place[1] - y), speed_mps)

    def _place(self) -> tuple[float, float]:
        return float(self.hull.state[L.X]), float(self.hull.state[L.Y])
