"""What each declared response asks a boat to do: a wanted command, which the shield then filters like any other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..jit import Array
from ..platforms import Platform
from ..platforms import layout as L
from .fleet_settings import Geofence
from .frame import TWO_PI

STRENGTH = {"go_on": 0, "hold_course": 1, "slow": 2, "hold_station": 3, "return": 4, "stop": 5}
"""Of several responses due at once the strongest is done."""

STATION_M = 3.0
"""A boat holding station steers back when farther from it than this, m."""

STATION_SHARE = 0.5
"""Share of top speed at which it does, and at which boats return into the geofence."""

INSIDE_M = 3.0
"""Boats return to this far inside the geofence, m."""


@dataclass(frozen=True)
class _Onset:
    """Where a boat was when a response began."""

    response: str
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float


class Responder:
    """Turns responses of one boat into wanted commands; remembers where each began.

    Args:
        platform: the boat's.
        fence: the water it may not leave.
    """

    def __init__(self, platform: Platform, fence: Geofence) -> None:
        self._slow_mps = STATION_SHARE * platform.max_speed_mps
        self._fence = fence
        self._onset: _Onset | None = None

    def clear(self) -> None:
        """No response is due any more."""
        self._onset = None

    def wanted(self, response: str, row: Array) -> tuple[float, float]:
        """Speed, m/s, and absolute heading, rad, that a response asks for.

        Args:
            response: one of `STRENGTH`, but "go_on".
            row: (N_STATE,) the boat now.
        """
        onset = self._onset
        if onset is None or onset.response != response:
            onset = _Onset(response, float(row[L.X]), float(row[L.Y]), _heading(row), max(0.0, float(row[L.SPEED])))
            self._onset = onset
        if response == "hold_course":
            return onset.speed_mps, onset.heading_rad
        if response == "slow":
            return 0.5 * onset.speed_mps, onset.heading_rad
        if response == "hold_station":
            return self._steer(row, onset.x_m, onset.y_m, STATION_M)
        if response == "return":
            return self._steer(row, *self._inside(row), 0.5)
        return _rest(row)

    def _inside(self, row: Array) -> tuple[float, float]:
        """The nearest place well inside the fence."""
        fence = self._fence
        return (
            _between(float(row[L.X]), fence.xmin_m, fence.xmax_m),
            _between(float(row[L.Y]), fence.ymin_m, fence.ymax_m),
        )

    def _steer(self, row: Array, x_m: float, y_m: float, near_m: float) -> tuple[float, float]:
        dx, dy = x_m - float(row[L.X]), y_m - float(row[L.Y])
        if math.hypot(dx, dy) <= near_m:
            return _rest(row)
        return self._slow_mps, math.atan2(dx, dy) % TWO_PI


def _heading(row: Array) -> float:
    return math.radians(float(row[L.HEADING])) % TWO_PI


def _rest(row: Array) -> tuple[float, float]:
    """No speed, on the heading the boat has by now.

    Turned away from an edge or a boat it lets it be. Sent back to the heading it had it would have to be turned away
    again, for which it takes thrust, and never come to rest.
    """
    return 0.0, _heading(row)


def _between(value: float, low: float, high: float) -> float:
    inset = min(INSIDE_M, 0.5 * (high - low))
    return min(max(value, low + inset), high - inset)


def strongest(responses: list[str]) -> str:
    """The strongest of some responses; "go_on" of none."""
    return max(responses, key=STRENGTH.__getitem__, default="go_on")
