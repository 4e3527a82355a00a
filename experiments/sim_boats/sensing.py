"""Sensors of a boat, with measured noise, and the radio to and from its commander."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from steerclear.shield.bridge.frame import FieldFrame

from .hull import STEP_S, Hull
from .settings import RadioSettings

_HEADING_RUNNING_RAD, _HEADING_AT_REST_RAD = math.radians(0.3), math.radians(1.7)
_SPREAD = np.array([0.06, 0.06, 0.035, 0.035])
"""Standard deviation of x, y in m and their rates in m/s; the heading's depends on the speed."""
_KEPT = np.exp(-STEP_S / np.array([10.0, 10.0, 1.0, 1.0, 3.0]))
"""Autocorrelation per step of the five errors, with time constants in s."""
_TURN_RATE_RADS = 0.003


@dataclass(frozen=True)
class Snapshot:
    """Sensor readings of one boat at one time, in the field's frame and in geodetic coordinates."""

    time_s: float  # simulated time of measurement, s
    x_m: float  # m
    y_m: float  # m
    latitude_deg: float  # deg
    longitude_deg: float  # deg
    velocity_mps: tuple[float, float]  # over ground along the field's axes, m/s
    heading_rad: float  # of the bow, clockwise from the field's y axis
    speed_mps: float  # along the bow over ground, negative astern, m/s
    turn_rate_rads: float  # clockwise
    has_fix: bool = True  # whether the position is from GPS; else it is dead reckoning

    def moved_to(self, frame: FieldFrame, x_m: float, y_m: float) -> Snapshot:
        """Return the snapshot moved to another position in the field, m."""
        latitude, longitude = frame.to_geodetic_deg(x_m, y_m)
        return replace(self, x_m=x_m, y_m=y_m, latitude_deg=latitude, longitude_deg=longitude)


class Sensors:
    """GPS, compass and gyro of one boat; noise: 0 none, 1 as measured."""

    def __init__(self, frame: FieldFrame, noise: float, random: np.random.Generator) -> None:
        self._frame, self._noise, self._random = frame, noise, random
        self._errors = random.standard_normal(5)

    def sense(self, hull: Hull, time_s: float) -> Snapshot:
        """Return the readings for the hull's current state."""
        (x, y), velocity, heading, rate = hull.position_m, hull.velocity_mps, hull.heading_rad, hull.turn_rate_rads
        if self._noise > 0.0:
            dx, dy, dvx, dvy, turn = self._drawn(hull)
            x, y, heading = x + dx, y + dy, heading + turn
            velocity = (velocity[0] + dvx, velocity[1] + dvy)
            rate += self._noise * _TURN_RATE_RADS * float(self._random.standard_normal())
        latitude, longitude = self._frame.to_geodetic_deg(x, y)
        along = velocity[0] * math.sin(heading) + velocity[1] * math.cos(heading)
        return Snapshot(time_s, x, y, latitude, longitude, velocity, heading, along, rate)

    def _drawn(self, hull: Hull) -> tuple[float, ...]:
        self._errors = _KEPT * self._errors + np.sqrt(1.0 - _KEPT**2) * self._random.standard_normal(5)
        running = min(abs(hull.speed_mps), 1.0)
        heading = _HEADING_AT_REST_RAD + running * (_HEADING_RUNNING_RAD - _HEADING_AT_REST_RAD)
        return tuple((self._noise * np.append(_SPREAD, heading) * self._errors).tolist())


Bend = Callable[[bytes], list[tuple[float, bytes]]]
"""A radio fault: returns what a packet becomes, as (extra delay s, bytes) of each copy."""


class Radio:
    """Delays packets until they arrive; ``bends``: active faults, in order; ``lost``: packets dropped so far."""

    def __init__(self, settings: RadioSettings, random: np.random.Generator) -> None:
        self._settings, self._random = settings, random
        self._waiting: list[tuple[float, int, bytes]] = []
        self._number = 0
        self.bends: list[Bend] = []
        self.lost = 0

    def put(self, packet: bytes, now_s: float) -> None:
        """Transmit a packet."""
        lost = self._settings.loss > 0.0 and self._random.random() < self._settings.loss
        copies = [] if lost else [(0.0, packet)]
        for bend in self.bends:
            copies = [(late + more, bent) for late, data in copies for more, bent in bend(data)]
        self.lost += not copies
        for late, data in copies:
            jitter_s = self._settings.jitter_s * self._random.random() if self._settings.jitter_s > 0.0 else 0.0
            self._number += 1
            heapq.heappush(self._waiting, (now_s + self._settings.delay_s + late + jitter_s, self._number, data))

    def take(self, now_s: float) -> Iterator[bytes]:
        """Yield packets that have arrived by now."""
        while self._waiting and self._waiting[0][0] <= now_s + 1e-9:
            yield heapq.heappop(self._waiting)[2]
