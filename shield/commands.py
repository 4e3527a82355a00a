"""Commanded heading and speed of several boats, in the frame they were given in.

Commands are stored as given, so that one that is safe passes bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .exceptions import FleetError
from .jit import Array, BoolArray

LARGEST_HEADING_RAD = 1e6
"""Absolute headings beyond this are no directions, rad: turns so many that the angle left in the number is lost."""


@dataclass(frozen=True)
class Commands:
    """Speed and heading of n boats.

    Attributes:
        values: (n, 2): speed m/s, heading in the frame.
        relative: heading is in deg relative to the boat's present heading (as the game's actions are); otherwise in
            rad, absolute, clockwise from north.
    """

    values: Array
    relative: bool

    @classmethod
    def relative_deg(cls, values: ArrayLike) -> Commands:
        """Commands of the game: (n, 2) of speed m/s and heading deg relative to the boat's own, clockwise.

        Raises:
            FleetError: the shape is wrong or the values are not numbers.
        """
        return cls(_as_commands(values), True)

    @classmethod
    def absolute_rad(cls, values: ArrayLike) -> Commands:
        """Commands as boats take them: (n, 2) of speed m/s and heading rad, clockwise from north.

        Raises:
            FleetError: the shape is wrong or the values are not numbers.
        """
        return cls(_as_commands(values), False)

    def __len__(self) -> int:
        return len(self.values)

    def as_relative_deg(self, heading_deg: Array) -> Array:
        """Values as (speed m/s, relative heading deg); absolute headings give errors in [-180, 180).

        Absolute ones beyond `LARGEST_HEADING_RAD` become NaN, and the shield holds the boat.
        """
        if self.relative:
            return self.values
        heading_rad = np.where(np.abs(self.values[:, 1]) <= LARGEST_HEADING_RAD, self.values[:, 1], np.nan)
        error = (np.degrees(heading_rad) - heading_deg + 180.0) % 360.0 - 180.0
        return np.stack([self.values[:, 0], error], axis=1)

    def absolute(self, i: int, heading_rad: float) -> tuple[float, float]:
        """Speed, m/s, and absolute heading, rad in [0, 2 pi), of boat i, whose present heading is given."""
        speed, heading = float(self.values[i, 0]), float(self.values[i, 1])
        if self.relative:
            heading = float(heading_rad) + math.radians(heading)
        return speed, heading % (2.0 * math.pi) if math.isfinite(heading) else heading

    def replaced(self, changed: BoolArray, relative: Array, heading_deg: Array) -> Commands:
        """These commands with the rows of ``changed`` taken from ``relative`` (speed m/s, relative deg)."""
        values = self.values.copy()
        rows = relative[changed]
        if not self.relative:
            rows = np.stack([rows[:, 0], np.radians(heading_deg[changed] + rows[:, 1])], axis=1)
        values[changed] = rows
        return Commands(values, self.relative)


def _as_commands(values: ArrayLike) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FleetError(f"commands are not numbers ({error}); give an (n, 2) array of speed and heading") from None
    if array.ndim != 2 or array.shape[1] != 2:
        raise FleetError(f"commands have shape {array.shape}; give (n, 2): speed m/s and heading per boat")
    return array
