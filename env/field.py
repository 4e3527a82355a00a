"""Geometry of the field: walls, dividing line, flag homes, named points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from .config import GameConfig

ROWS = ("B", "F", "H", "M", "C", "MX", "HX", "FX", "BX")
"""Rows of named points from the blue end (x = 0) to the red end; "X" marks the opponent's half as seen by blue."""
COLUMNS = ("PP", "P", "C", "S", "SS")
"""Columns of named points from port (y = height) to starboard (y = 0), as seen from the blue end."""

CORNER_INSET_M = 10.0
"""Distance from a corner, along both edges, of the point that tagged boats are steered to."""


@dataclass(frozen=True)
class FieldGeometry:
    """Fixed lines and points of a field, m."""

    size: Array  # (2,) width and height
    diagonal: float  # length of the diagonal
    flag_home: Array  # (2, 2) homes of the blue and the red flag
    scrimmage: Array  # (2, 2) ends of the dividing line
    # (2, 4, 2, 2) the four walls of each team, as segments. Wall 1 is behind the own flag; the others follow round the
    # field in the same direction for both teams, so that both see the same picture.
    walls: Array
    side_sign: Array  # (2,) sign of the cross product (line x point) on each team's side


def field_geometry(config: GameConfig) -> FieldGeometry:
    """Return the geometry of a config's field.

    Raises:
        ConfigError: a flag is outside the field, or the dividing line does not part the flags.
    """
    size = np.array(config.env_bounds_m)
    homes = _flag_homes(config, size)
    scrimmage = _scrimmage(config, size, homes)
    along = scrimmage[1] - scrimmage[0]
    sides = np.array([_cross(along, home - scrimmage[0]) for home in homes])
    if sides[0] * sides[1] >= 0:
        raise ConfigError("scrimmage_m does not part the two flag homes; move the line or the flags")
    walls = np.stack([_walls_of_team(size, homes, team) for team in (0, 1)])
    return FieldGeometry(size, float(np.linalg.norm(size)), homes, scrimmage, walls, np.sign(sides))


def own_corners(size: Array, inset_m: float) -> Array:
    """Return the two corners of each team's side, upper first, moved inwards along both edges: (2, 2, 2), m."""
    (left, low), (right, high) = (inset_m, inset_m), size - inset_m
    return np.array([[[left, high], [left, low]], [[right, high], [right, low]]])


def field_points(size: Array) -> dict[str, Array]:
    """Return the named points of the 9 x 5 grid in blue's naming, name -> (x, y) m."""
    points = {}
    for i, row in enumerate(ROWS):
        for j, column in enumerate(COLUMNS):
            # the middle column is named by one letter, so row C has its letter once: PC, CC, SC
            points[column + row] = np.array([i / 8.0, (4 - j) / 4.0]) * size
    return points


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _flag_homes(config: GameConfig, size: Array) -> Array:
    if config.blue_flag_home_m is None or config.red_flag_home_m is None:
        return np.array([[size[0] / 8.0, size[1] / 2.0], [size[0] * 7.0 / 8.0, size[1] / 2.0]])
    homes = np.array([config.blue_flag_home_m, config.red_flag_home_m])
    for home in homes:
        if not ((home > 0.0) & (home < size)).all():
            raise ConfigError(
                f"flag home {tuple(home.tolist())} lies outside the field {tuple(size.tolist())}; move it inside"
            )
    return homes


def line_through_field(size: Array, point: Array, direction: Array) -> Array:
    """Return the two points (2, 2) where a line leaves the field: first along ``direction``, then against it."""
    low, high = -math.inf, math.inf
    for axis in (0, 1):
        if direction[axis] == 0.0:
            if not 0.0 <= point[axis] <= size[axis]:
                low, high = 1.0, 0.0
            continue
        ends = sorted(((0.0 - point[axis]) / direction[axis], (size[axis] - point[axis]) / direction[axis]))
        low, high = max(low, ends[0]), min(high, ends[1])
    if low >= high:
        raise ConfigError("scrimmage_m does not cross the field; give two points whose line does")
    return np.array([point + high * direction, point + low * direction])


def _scrimmage(config: GameConfig, size: Array, homes: Array) -> Array:
    if config.scrimmage_m is not None:
        ends = np.array(config.scrimmage_m)
        return line_through_field(size, ends[0], ends[0] - ends[1])
    between = homes[0] - homes[1]
    if not between.any():
        raise ConfigError("both flags have the same home; move one")
    middle = 0.5 * (homes[0] + homes[1])
    return line_through_field(size, middle, np.array([-between[1], between[0]]))


def _walls_of_team(size: Array, homes: Array, team: int) -> Array:
    """Return four segments, numbered so that a ray from midfield through the own flag meets number 1."""
    width, height = size
    upper_left, upper_right = (0.0, height), (width, height)
    lower_right, lower_left = (width, 0.0), (0.0, 0.0)
    clockwise = [
        (upper_left, upper_right),
        (upper_right, lower_right),
        (lower_right, lower_left),
        (lower_left, upper_left),
    ]
    middle = 0.5 * (homes[0] + homes[1])
    ray = homes[team] - middle
    reach = [
        (height - middle[1]) / ray[1] if ray[1] > 0 else math.inf,
        (width - middle[0]) / ray[0] if ray[0] > 0 else math.inf,
        -middle[1] / ray[1] if ray[1] < 0 else math.inf,
        -middle[0] / ray[0] if ray[0] < 0 else math.inf,
    ]
    behind_flag = int(np.argmin(reach))
    return np.array([clockwise[(behind_flag - 1 + i) % 4] for i in range(4)])
