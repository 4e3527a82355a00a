"""`Surroundings`: field edge, obstacles and keep-out circles that boats stay clear of.

All of them yield to keeping clear of known boats. A boat stopped by an obstacle cannot escape, so near obstacles come
before pursuing opponents. Edge and keep-out circles are rules and come after pursuers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import NoNumbersError, numbers
from .barriers.static import LEAVE_S
from .calls import checked_calls
from .config import ShieldConfig
from .exceptions import ConfigError
from .fleet import LARGEST
from .jit import Array
from .shared import share
from .tracks import steps_of_delay
from .workspace import Registered, Static, new_registered

Point = tuple[float, float]

LAST_SHARE = 0.5
"""A boat is stopped before an obstacle within this share of its clearance; until then it may turn away."""

NOWHERE = np.array([-np.inf, -np.inf, np.inf, np.inf])
"""The edge where there is none."""

OUTWARDS = np.array([-1.0, -1.0, 1.0, 1.0])


@checked_calls()
@dataclass(frozen=True)
class Surroundings:
    """Static constraints, in m, east and north.

    Attributes:
        field: (xmin, ymin, xmax, ymax) to stay inside, or None.
        circles: (x, y, radius) of round obstacles.
        polygons: corner lists; their edges are walls, which boats stay outside of, or inside.
        keep_out: (x, y, radius) that the boat's centre stays out of, by rule.
        stops: (x, y, radius) at which the boat's centre is stopped, such as the own flag's circle in the games: an
            obstacle without a clearance.

    Raises:
        ConfigError: a value is not finite or beyond 1e9, a radius negative, a polygon has fewer than three corners, or
            the field is empty.
    """

    field: tuple[float, float, float, float] | None = None
    circles: Sequence[tuple[float, float, float]] = ()
    polygons: Sequence[Sequence[Point]] = ()
    keep_out: Sequence[tuple[float, float, float]] = ()
    stops: Sequence[tuple[float, float, float]] = ()

    def __post_init__(self) -> None:
        if self.field is not None:
            object.__setattr__(self, "field", _row("field", self.field, "(xmin, ymin, xmax, ymax)"))
            if not (self.field[0] < self.field[2] and self.field[1] < self.field[3]):
                raise ConfigError(f"field {self.field} is empty; give (xmin, ymin, xmax, ymax)")
        for name in ("circles", "keep_out", "stops"):
            object.__setattr__(self, name, _rows(name, getattr(self, name), "(x, y, radius)"))
            if any(radius < 0 for *_, radius in getattr(self, name)):
                raise ConfigError(f"{name} holds a negative radius; give (x, y, radius) with radius >= 0")
        polygons = tuple(
            _rows("polygons", line, "(x, y)") for line in _each("polygons", self.polygons, "corners (x, y)")
        )
        object.__setattr__(self, "polygons", polygons)
        if any(len(polygon) < 3 for polygon in polygons):
            raise ConfigError("a polygon has fewer than three corners; give [(x, y), (x, y), (x, y), ...] in m")

    def pack(self, config: ShieldConfig, registered: Registered | None = None) -> Static:
        """Return arrays for compiled code, widened by the distances of the settings and by how far off a boat may be.

        That includes the drift in a current until a command has acted, and a little longer.

        Raises:
            ConfigError: nothing of the field is left.
        """
        wider_m = uncertainty_m(config)
        hull_m, stop = config.obstacle_clearance_m + wider_m, config.beyond_then == "stop"
        circles = [(x, y, r + config.obstacle_clearance_m + wider_m) for x, y, r in self.circles]
        circles += [(x, y, r + wider_m) for x, y, r in self.stops]
        segments = [(*polygon[k - 1], *polygon[k]) for polygon in self.polygons for k in range(len(polygon))]
        line = NOWHERE
        if self.field is not None and config.beyond_m is not None and stop:
            line = np.array(self.field) + config.beyond_m * OUTWARDS
        return share(
            Static(
                field=self._edge(config),
                keep_out=np.array([(x, y, r + wider_m) for x, y, r in self.keep_out], dtype=np.float64).reshape(-1, 3),
                circles=np.array(circles, dtype=np.float64).reshape(-1, 3),
                segments=np.array(segments, dtype=np.float64).reshape(-1, 4),
                segment_m=hull_m,
                side_m=wider_m,
                current_mps=float(config.current_mps),
                line=line.copy(),
                last_circles=len(self.circles) if stop else 0,
                last_segments=len(segments) if stop else 0,
                last_m=LAST_SHARE * config.obstacle_clearance_m,
                registered=new_registered() if registered is None else registered,
            )
        )

    def _edge(self, config: ShieldConfig) -> Array:
        """Return the rectangle (xmin, ymin, xmax, ymax) to stay inside, m; infinite where there is none."""
        if self.field is None or config.edge_m is None:
            return NOWHERE.copy()
        inside_m = config.edge_m + uncertainty_m(config)
        edge = np.array(self.field) - inside_m * OUTWARDS
        if not (edge[0] < edge[2] and edge[1] < edge[3]):
            raise ConfigError(
                f"field {self.field} is too small to keep {inside_m:g} m inside its edge; give a larger field, "
                "a smaller edge_m, position_error_m or current_mps, or edge_m None to leave the edge to the policy"
            )
        return edge


def uncertainty_m(config: ShieldConfig) -> float:
    """Return how far off a boat may be one step ahead, m, with room to turn; later drift is added along paths."""
    return config.position_error_m + config.current_mps * (
        steps_of_delay(config) * config.dt_s + config.dt_s + 2.0 * LEAVE_S
    )


def _each(name: str, value: object, form: str) -> tuple[Any, ...]:
    """Return the entries of a list."""
    try:
        if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
            raise TypeError("it is no list")
        return tuple(value)
    except Exception as error:  # foreign objects may raise anything
        raise ConfigError(f"{name} holds {value!r}, no list ({error}); give a list of {form} in m") from None


def _rows(name: str, value: object, form: str) -> tuple[Any, ...]:
    return tuple(_row(name, row, form) for row in _each(name, value, form))


def _row(name: str, row: object, form: str) -> tuple[float, ...]:
    """Return a row as a tuple of finite floats of a sensible size, as many as ``form`` names."""
    try:
        array = numbers(row)
    except NoNumbersError:
        array = np.zeros((0, 0))
    if array.shape != (form.count(",") + 1,):
        raise ConfigError(f"{name} holds {row!r}; give {form} in m")
    if not (np.abs(array) <= LARGEST).all():
        raise ConfigError(
            f"{name} holds a value that is not finite or beyond {LARGEST:g} m: {row}; give {form} from a place nearby"
        )
    return tuple(array.tolist())


OPEN_WATER = Surroundings()
"""No edge, no obstacle."""
