"""What does not move around the boats: shores and keep-out areas of a FLEET.yaml, and what the shield is given."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..exceptions import FleetFileError
from ..surroundings import OPEN_WATER, Surroundings
from .feed_packets import GameState
from .fleet_settings import Obstacle
from .frame import FieldFrame

if TYPE_CHECKING:
    from .fleet_file import FleetFile

FORMS = ("polygon_m", "polygon_deg", "circle_m", "geojson")
MOST_EDGES = 400  # of all obstacles together: the shield looks at each at every turn
FARTHEST_M = 20_000.0  # an obstacle farther from the geofence is in another water, or its numbers are in another order
MOST_BYTES = 4 << 20  # of a GeoJSON file
Line = tuple[tuple[float, float], ...]


def read_obstacles(fleet: FleetFile) -> tuple[Obstacle, ...]:
    """The obstacles of a file, those of GeoJSON files as ``polygon_deg``.

    Raises:
        FleetFileError: one has not one form, lies far from the geofence or cannot be read, or they have too many edges;
            with its place in the file and the remedy.
    """
    found, edges = [], 0
    for number, obstacle in enumerate(fleet.obstacles):
        which = f"obstacles[{number}]" + (f" ({obstacle.name})" if obstacle.name else "")
        given = [form for form in FORMS if getattr(obstacle, form) is not None]
        if len(given) != 1:
            has = " and ".join(given) or "no form"
            raise FleetFileError(f"{which} has {has}; give one of {', '.join(FORMS)}")
        parts = [obstacle]
        if obstacle.geojson is not None:
            lines = _geojson_lines(obstacle.geojson, f"{which}.geojson")
            parts = [obstacle.model_copy(update={"geojson": None, "polygon_deg": line}) for line in lines]
        for corners in (corners_m(part, fleet.frame) for part in parts):
            edges += len(corners)
            far_m = max((fleet.geofence.outside_m(*corner) for corner in corners), default=0.0)
            if not far_m <= FARTHEST_M:
                raise FleetFileError(
                    f"{which}: a corner lies {far_m / 1e3:.0f} km from the geofence; give polygon_deg as "
                    "[latitude, longitude], GeoJSON as [longitude, latitude], polygon_m in m"
                )
        found += parts
    if edges > MOST_EDGES:
        raise FleetFileError(f"obstacles have {edges} edges, more than {MOST_EDGES}; simplify them")
    return tuple(found)


def corners_m(obstacle: Obstacle, frame: FieldFrame) -> Line:
    """Corners of a polygon, m in the field's frame; none of a circle."""
    if obstacle.polygon_deg is not None:
        return tuple(frame.to_field_m(*place) for place in obstacle.polygon_deg)
    return obstacle.polygon_m or ()


def _geojson_lines(path: Path, key: str) -> list[Line]:
    """Corners (latitude, longitude), deg, of all rings and lines of a file, each a closed polygon."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FleetFileError(f"{key}: {path} is larger than {MOST_BYTES >> 20} MiB; cut it to the water you use")
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        why = getattr(error, "strerror", None) or error
        raise FleetFileError(f"{key}: cannot read {path} ({why}); give the path of a GeoJSON file") from None
    try:
        lines = [_closed(line) for line in _lines(content)]
    except (TypeError, ValueError, KeyError, AttributeError, RecursionError) as error:
        raise FleetFileError(f"{key}: {path} is no GeoJSON ({error}); give one of polygons or lines") from None
    if not lines:
        raise FleetFileError(f"{key}: {path} holds no polygon or line; give a GeoJSON file of shores")
    return lines


def _lines(node: Any) -> Iterator[Sequence[Sequence[float]]]:
    """Lists of positions [longitude, latitude, ...] below a GeoJSON object; points bound nothing and are left out."""
    kind = node["type"]
    if kind in ("FeatureCollection", "GeometryCollection"):
        for part in node["features" if kind == "FeatureCollection" else "geometries"]:
            yield from _lines(part)
    elif kind == "Feature":
        if node["geometry"] is not None:
            yield from _lines(node["geometry"])
    elif kind == "LineString":
        yield node["coordinates"]
    elif kind in ("Polygon", "MultiLineString"):
        yield from node["coordinates"]
    elif kind == "MultiPolygon":
        for polygon in node["coordinates"]:
            yield from polygon
    elif kind not in ("Point", "MultiPoint"):
        raise ValueError(f"unknown type {kind!r}")


def _closed(line: Sequence[Sequence[float]]) -> Line:
    """A ring without its last corner, which repeats the first; an open line there and back."""
    places = [(float(position[1]), float(position[0])) for position in line]
    if any(not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0) for latitude, longitude in places):
        raise ValueError("a position is not [longitude, latitude] in deg")
    if len(places) > 3 and places[0] == places[-1]:
        return tuple(places[:-1])
    if len(places) < 2:
        raise ValueError("a line has fewer than two positions")
    (a, b), (c, d) = places[:2]
    whole = [places[0], (0.5 * (a + c), 0.5 * (b + d)), *places[1:]]
    return tuple(whole + whole[-2:0:-1])


class StaticObstacles:
    """The operating area, obstacles, and the own flag's circle while a referee keeps the game.

    The game stops a boat in its own flag's circle, and who is stopped is caught: on the water the shield is told of it
    as in the simulator, whether the flag is home or not, for it may come home at any time. Without a referee, or once
    he is silent for longer than the file allows, nobody stops boats.

    Args:
        file: the file; its geofence is the operating area, whatever field the game has.
        surroundings: static constraints of the game: its obstacles, and the own flag's circle as ``stops``.
    """

    def __init__(self, file: FleetFile, surroundings: Surroundings = OPEN_WATER) -> None:
        self._game_max_age_s = file.limits.game.max_age_s
        fixed = file.surroundings
        self._with_referee = replace(
            surroundings,
            field=fixed.field,
            polygons=(*fixed.polygons, *surroundings.polygons),
            circles=(*fixed.circles, *surroundings.circles),
        )
        self._without = replace(self._with_referee, stops=())

    @property
    def forms(self) -> tuple[Surroundings, ...]:
        """What may be around boats: without a referee, and with one."""
        return (self._without, self._with_referee) if self._with_referee.stops else (self._without,)

    def around(self, game: GameState | None = None, game_age_s: float = math.inf) -> Surroundings:
        """What is around boats now, by the state of the game (None: none yet) and its age, s.

        A referee silent for too long counts as none: the circle is a rule of the game, and nothing on the water stops a
        boat in it, so it must not press boats towards opponents on the word of nobody.
        """
        is_kept = game is not None and not game.over and game_age_s <= self._game_max_age_s
        return self.forms[-1] if is_kept else self._without
