"""Wind and current, as the drift they give every boat."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.bridge.frame import FieldFrame

from .settings import Water

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
