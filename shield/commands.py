"""Commanded heading and speed of several boats, in the frame in which they were given.

Commands are stored as given, so that a safe one passes bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .arrays import hint_at_degrees, say_once, shaped
from .exceptions import FleetError
from .jit import Array, BoolArray, kernel
from .workspace import LARGEST_COMMAND

ROUNDING_MPS = 1e-6
"""A speed beyond the limit by at most this is the limit, rounded: it passes unchanged."""

FASTEST_MPS = 50.0
"""Speeds beyond this are those of no boat, m/s: headings, probably."""

LARGEST_HEADING_RAD = 1e6
"""Absolute headings beyond this, rad, are not valid: too little of the angle is left in a float."""


@kernel
def _any_beyond(values: Array, who: BoolArray, highest_mps: Array) -> bool:
    """Return whether a speed of boats of ``who`` is beyond what their platforms do, or any beyond what boats do."""
    for i in range(values.shape[0]):
        if who[i] and (values[i, 0] > highest_mps[i] + ROUNDING_MPS or values[i, 0] < -ROUNDING_MPS):
            return True
        if abs(values[i, 0]) > FASTEST_MPS:
            return True
    return False


@dataclass(frozen=True)
class Commands:
    """Speed and heading of n boats.

    Build them with one of the class methods, which copy their arguments.

    Attributes:
        values: (n, 2) speed m/s, and heading in the frame; converted to float64.
        relative: the heading is in deg, relative to the boat's present heading (as the game's actions are); otherwise
            in rad, absolute, clockwise from north.
        of_game: the receiver limits speeds itself, as games do. The shield then leaves speeds beyond a boat's top speed
            as they are; otherwise it cuts them.

    Raises:
        FleetError: the shape is wrong, the values are not numbers (True and False are not), or ``relative`` is neither
            True nor False.
    """

    values: Array
    relative: bool
    of_game: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", _rows(self.values))
        if not isinstance(self.relative, (bool, np.bool_)):
            raise FleetError(
                f"relative is {self.relative!r}; give True or False, or build commands with Commands.absolute_rad, "
                "absolute_deg or relative_deg"
            )
        if not self.relative:
            remedy = "give Commands.absolute_deg; rows are (speed m/s, heading), in this order"
            hint_at_degrees("Commands.absolute_rad", self.values[:, 1], remedy)

    @classmethod
    def relative_deg(cls, values: ArrayLike) -> Commands:
        """Build commands to turn: (n, 2) of speed m/s and heading deg relative to the boat's own, clockwise."""
        return cls(_rows(values).copy(), True)

    @classmethod
    def game_deg(cls, values: ArrayLike) -> Commands:
        """Build commands of a game, which limits speeds itself: (n, 2) of speed m/s, turn deg, clockwise."""
        return cls(_rows(values).copy(), True, True)

    @classmethod
    def absolute_rad(cls, values: ArrayLike) -> Commands:
        """Build commands as boats take them: (n, 2) of speed m/s and heading rad, clockwise from north."""
        return cls(_rows(values).copy(), False)

    @classmethod
    def absolute_deg(cls, values: ArrayLike) -> Commands:
        """Build commands from degrees: (n, 2) of speed m/s and heading deg, clockwise from north; stored in rad."""
        array = _rows(values).copy()
        with np.errstate(invalid="ignore"):  # infinite ones become NaN, and the shield holds the boat
            array[:, 1] = np.radians(np.fmod(array[:, 1], 360.0))
        return cls(array, False)

    def __len__(self) -> int:
        return len(self.values)

    def as_relative_deg(self, heading_deg: Array) -> Array:
        """Return values as (speed m/s, relative heading deg); absolute headings give errors in [-180, 180).

        Absolute headings beyond `LARGEST_HEADING_RAD` become NaN, and the shield holds the boat.
        """
        if self.relative:
            return self.values
        heading_rad = np.where(np.abs(self.values[:, 1]) <= LARGEST_HEADING_RAD, self.values[:, 1], np.nan)
        error = (np.degrees(heading_rad) - heading_deg + 180.0) % 360.0 - 180.0
        return np.stack([self.values[:, 0], error], axis=1)

    def absolute(self, i: int, heading_rad: float) -> tuple[float, float]:
        """Return speed, m/s, and absolute heading, rad in [0, 2 pi), of boat i, now on ``heading_rad``."""
        speed, heading = float(self.values[i, 0]), float(self.values[i, 1])
        if self.relative:
            heading = float(heading_rad) + math.radians(heading)
        return speed, heading % (2.0 * math.pi) if math.isfinite(heading) else heading

    def replaced(self, changed: BoolArray, relative: Array, heading_deg: Array) -> Commands:
        """Return these commands with the rows of ``changed`` taken from ``relative`` (speed m/s, relative deg)."""
        values, rows = self.values.copy(), relative[changed]
        if not self.relative:
            rows = np.stack([rows[:, 0], np.radians(heading_deg[changed] + rows[:, 1])], axis=1)
        values[changed] = rows
        return self._alike(values)

    def _alike(self, values: Array) -> Commands:
        """Return commands of the same frame without checking the values: decisions make many."""
        made = object.__new__(Commands)
        made.__dict__.update(self.__dict__, values=values)
        return made

    def within(
        self, names: tuple[str, ...], controlled: BoolArray, highest_mps: Array
    ) -> tuple[Commands, BoolArray | None]:
        """Return these commands with own boats' speeds cut to their platforms' range, and (n,) which are cut, or None.

        No platform is sent astern: none has a speed below 0 in its model. Commands that are not valid (not finite, or
        beyond `LARGEST_COMMAND`) are left to the decision, which holds those boats.
        """
        if self.of_game or not _any_beyond(self.values, controlled, highest_mps):
            return self, None
        speed = self.values[:, 0]
        _hint_at_swapped_columns(names, speed, ~controlled)
        cut: BoolArray = controlled & ((speed > highest_mps + ROUNDING_MPS) | (speed < -ROUNDING_MPS))
        cut &= (np.abs(self.values) <= LARGEST_COMMAND).all(axis=1)
        if not cut.any():
            return self, None
        first = int(np.argmax(cut))
        say_once(
            "speed",
            f"a speed of {speed[first]:g} m/s is requested of boat {names[first]!r}, whose platform does 0 to "
            f"{highest_mps[first]:g} m/s; it is cut to that (reason LIMITED). Rows are (speed m/s, heading), in this "
            "order",
        )
        values = self.values.copy()
        values[cut, 0] = np.clip(speed[cut], 0.0, highest_mps[cut])
        if self.relative:
            far = cut & (np.abs(values[:, 1]) > 180.0)
            half = np.copysign(180.0, values[far, 1])
            values[far, 1] = np.fmod(values[far, 1] + half, 360.0) - half
        return self._alike(values), cut


def _hint_at_swapped_columns(names: tuple[str, ...], speed_mps: Array, who: BoolArray) -> None:
    """Warn once if speeds of boats of ``who``, which the shield passes through, look like headings."""
    absurd = who & (np.abs(speed_mps) > FASTEST_MPS)
    if absurd.any():
        first = int(np.argmax(absurd))
        say_once(
            "speed of others",
            f"a speed of {speed_mps[first]:g} m/s is given for boat {names[first]!r}; rows are (speed m/s, heading), "
            "in this order",
        )


def _rows(values: ArrayLike) -> Array:
    rows: Array = shaped("array of commands (speed m/s, heading)", values, (None, 2))
    return rows
