"""The field's frame: metres along and across it, from latitude and longitude, and headings to go with it.

The only place in `bridge` that converts positions and headings; everything else is in the field's frame: x and y m from
the field's corner, headings rad clockwise from its y axis, as `Fleet` has them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymap3d

from ..exceptions import ConfigError

TWO_PI = 2.0 * math.pi


@dataclass(frozen=True)
class FieldFrame:
    """A local tangent plane (WGS 84) at the field's corner, turned so that its y axis points along ``y_axis_deg``.

    Raises:
        ConfigError: a value is not finite or not on earth.
    """

    latitude_deg: float  # of the corner, deg
    longitude_deg: float
    y_axis_deg: float = 0.0  # true course of the field's y axis, deg clockwise from north

    def __post_init__(self) -> None:
        if not (abs(self.latitude_deg) <= 89.0 and abs(self.longitude_deg) <= 180.0):
            raise ConfigError(
                f"origin ({self.latitude_deg}, {self.longitude_deg}) is no place; give latitude_deg within +-89 and "
                "longitude_deg within +-180"
            )
        if not abs(self.y_axis_deg) <= 360.0:
            raise ConfigError(f"y_axis_deg is {self.y_axis_deg}; give a course in deg, clockwise from north")

    def to_field_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Field coordinates (x, y), m, of a place."""
        east, north, _ = pymap3d.geodetic2enu(
            latitude_deg, longitude_deg, 0.0, self.latitude_deg, self.longitude_deg, 0.0
        )
        return self.turn_to_field(float(east), float(north))

    def to_geodetic_deg(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Latitude and longitude, deg, of a point of the field."""
        east, north = self.turn_to_earth(x_m, y_m)
        latitude, longitude, _ = pymap3d.enu2geodetic(east, north, 0.0, self.latitude_deg, self.longitude_deg, 0.0)
        return float(latitude), float(longitude)

    def turn_to_field(self, east: float, north: float) -> tuple[float, float]:
        """A vector east and north, along the field's axes."""
        c, s = self._cos_sin()
        return c * east - s * north, s * east + c * north

    def turn_to_earth(self, x: float, y: float) -> tuple[float, float]:
        """A vector along the field's axes, east and north."""
        c, s = self._cos_sin()
        return c * x + s * y, -s * x + c * y

    def heading_to_field_rad(self, true_rad: float) -> float:
        """Heading in the field, rad in [0, 2 pi), of one clockwise from true north."""
        return (true_rad - math.radians(self.y_axis_deg)) % TWO_PI

    def heading_to_true_rad(self, field_rad: float) -> float:
        """Heading clockwise from true north, rad in [0, 2 pi), of one in the field."""
        return (field_rad + math.radians(self.y_axis_deg)) % TWO_PI

    def _cos_sin(self) -> tuple[float, float]:
        turn = math.radians(self.y_axis_deg)
        return math.cos(turn), math.sin(turn)
