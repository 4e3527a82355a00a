"""What does not move around the boats: shores and keep-out areas of a FLEET.yaml, and what the shield is given."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..exceptions import FleetFileError
from ..jit import Array
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
AROUND = "a shore around your water is a GeoJSON LineString, which has no inside"


def read_obstacles(fleet: FleetFile) -> tuple[Obstacle, ...]:
    """The obstacles of a file, those of GeoJSON files as ``polygon_deg``.

    Raises:
        FleetFileError: one has not one form, lies far from the geofence, crosses itself, covers the field or cannot be
            read, or they have too many edges; with its place in the file and the remedy.
    """
    found: list[Obstacle] = []
    edges = 0
    for number, obstacle in enumerate(fleet.obstacles):
        which = f"obstacles[{number}]" + (f" ({obstacle.name})" if obstacle.name else "")
        given = [form for form in FORMS if getattr(obstacle, form) is not None]
        if len(given) != 1:
            has = " and ".join(given) or "no form"
            raise FleetFileError(f"{which} has {has}; give one of {', '.join(FORMS)}")
        label, before = obstacle.name or which, len(found) + 1
        parts = [obstacle.of_area(before, label)]
        if obstacle.geojson is not None:
            lines = _geojson_lines(obstacle.geojson, f"{which}.geojson")
            parts = [
                obstacle.model_copy(update={"geojson": None, "polygon_deg": line}).of_area(
                    before + k if is_ring else -before - k, label
                )
                for k, is_ring, line in lines
            ]
        for corners in (corners_m(part, fleet.frame) for part in parts):
            edges += len(corners)
            far_m = max((fleet.geofence.outside_m(*corner) for corner in corners), default=0.0)
            if not far_m <= FARTHEST_M:
                raise FleetFileError(
                    f"{which}: a corner lies {far_m / 1e3:.0f} km from the geofence; give polygon_deg as "
                    "[latitude, longitude], GeoJSON as [longitude, latitude], polygon_m in m"
                )
        for area in areas(parts, fleet.frame):
            if area.crosses_itself:
                raise FleetFileError(f"{which}: its line crosses itself; give its corners in order around it")
            if any(area.covers(box) for box in ((0.0, 0.0, *fleet.field.size_m), fleet.geofence.box)):
                raise FleetFileError(f"{which} covers the whole field or geofence; correct it; {AROUND}")
        found += parts
    if edges > MOST_EDGES:
        raise FleetFileError(f"obstacles have {edges} edges, more than {MOST_EDGES}; simplify them")
    return tuple(found)


def corners_m(obstacle: Obstacle, frame: FieldFrame) -> Line:
    """Corners of a polygon, m in the field's frame; none of a circle."""
    if obstacle.polygon_deg is not None:
        return tuple(frame.to_field_m(*place) for place in obstacle.polygon_deg)
    return obstacle.polygon_m or ()


@dataclass(frozen=True)
class Area:
    """Water that a boat cannot lie in: what rings bound together (a hole lies outside), or a circle; or a wall.

    Attributes:
        name: of the obstacle.
        rings: corners of each, m.
        circle: (x, y, radius), m; None: it has rings.
        has_inside: whether it bounds anything; a wall does not.
    """

    name: str
    rings: tuple[Line, ...] = ()
    circle: tuple[float, float, float] | None = None
    has_inside: bool = True

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a point lies inside."""
        if self.circle is not None:
            return math.dist((x_m, y_m), self.circle[:2]) < self.circle[2]
        if not self.has_inside:
            return False
        (x1, y1), (x2, y2) = self._edges()
        crossed = (y1 > y_m) != (y2 > y_m)
        x = x1[crossed] + (y_m - y1[crossed]) / (y2 - y1)[crossed] * (x2 - x1)[crossed]
        return bool((x > x_m).sum() % 2)  # a ray from an inner point crosses the rings an odd number of times

    def distance_m(self, x_m: float, y_m: float) -> float:
        """How far its edge is from a point on either side, m."""
        if self.circle is not None:
            return abs(math.dist((x_m, y_m), self.circle[:2]) - self.circle[2])
        begin, end = self._edges()
        way, off = end - begin, np.array([[x_m], [y_m]]) - begin
        share = np.clip((way * off).sum(axis=0) / np.maximum((way**2).sum(axis=0), 1e-12), 0.0, 1.0)
        return float(np.hypot(*(off - share * way)).min())

    def covers(self, box: tuple[float, float, float, float]) -> bool:
        """Whether all of a rectangle (xmin, ymin, xmax, ymax), m, lies inside."""
        low, high = np.array(box[:2]), np.array(box[2:])
        if self.circle is not None:
            farthest = np.maximum(np.abs(np.array(self.circle[:2]) - low), np.abs(np.array(self.circle[:2]) - high))
            return float(np.hypot(*farthest)) <= self.circle[2]
        middle = 0.5 * (low + high)
        return self.holds(*middle) and not self._enters(low, high)

    @property
    def crosses_itself(self) -> bool:
        """Whether two edges of one ring cross, each between the ends of the other."""
        return self.has_inside and any(_crosses_itself(np.array(ring)) for ring in self.rings)

    def _edges(self) -> tuple[Array, Array]:
        """Ends of all edges, each (2, n), m."""
        begin = np.concatenate([np.roll(np.array(ring), 1, axis=0) for ring in self.rings])
        return begin.T, np.concatenate([np.array(ring) for ring in self.rings]).T

    def _enters(self, low: Array, high: Array) -> bool:
        """Whether an edge passes through the inside of a rectangle: its part between the sides is no point."""
        begin, end = self._edges()
        way = end - begin
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (low[:, None] - begin) / way, (high[:, None] - begin) / way
        still = way == 0.0
        within = (begin > low[:, None]) & (begin < high[:, None])
        first = np.where(still, np.where(within, 0.0, np.inf), np.minimum(one, other))
        last = np.where(still, np.where(within, 1.0, -np.inf), np.maximum(one, other))
        return bool((np.minimum(last.min(axis=0), 1.0) > np.maximum(first.max(axis=0), 0.0)).any())


def _crosses_itself(ring: Array) -> bool:
    a, b = np.roll(ring, 1, axis=0), ring

    def side(point: Array) -> Array:
        """On which side of each edge (rows) each point (columns) lies."""
        off, way = point[None] - a[:, None], (b - a)[:, None]
        return np.asarray(np.sign(way[..., 0] * off[..., 1] - way[..., 1] * off[..., 0]))

    apart = side(a) * side(b) < 0.0  # the ends of an edge (column) lie on both sides of another (row)
    return bool((apart & apart.T).any())


def areas(obstacles: Sequence[Obstacle], frame: FieldFrame) -> list[Area]:
    """The areas that obstacles bound, and their walls."""
    found = []
    for number, parts in groupby(obstacles, key=lambda obstacle: obstacle.area):
        first, *more = parts
        rings = () if first.circle_m else tuple(corners_m(part, frame) for part in (first, *more))
        found.append(Area(first.label, rings, first.circle_m, number > 0))
    return found


def _geojson_lines(path: Path, key: str) -> list[tuple[int, bool, Line]]:
    """Corners (latitude, longitude), deg, of all rings and lines of a file, each a closed polygon.

    Each with its polygon's number, which its rings share, and whether it is a ring: a line bounds nothing.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FleetFileError(f"{key}: {path} is larger than {MOST_BYTES >> 20} MiB; cut it to the water you use")
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except json.JSONDecodeError as error:
        raise FleetFileError(f"{key}: {path} is no GeoJSON: no JSON ({error}); give one of polygons or lines") from None
    except UnicodeDecodeError:
        raise FleetFileError(f"{key}: {path} is no UTF-8 (UTF-16?); save it as UTF-8") from None
    except (OSError, ValueError, RecursionError) as error:
        why = getattr(error, "strerror", None) or error
        raise FleetFileError(f"{key}: cannot read {path} ({why}); give the path of a GeoJSON file") from None
    try:
        lines = [(k, is_ring, _closed(line)) for k, (is_ring, part) in enumerate(_parts(content)) for line in part]
    except (TypeError, ValueError, KeyError, AttributeError, RecursionError) as error:
        raise FleetFileError(f"{key}: {path} is no GeoJSON ({error}); give one of polygons or lines") from None
    if not lines:
        raise FleetFileError(f"{key}: {path} holds no polygon or line; give a GeoJSON file of shores")
    return lines


def _parts(node: Any) -> Iterator[tuple[bool, Sequence[Sequence[Sequence[float]]]]]:
    """Polygons and lines below a GeoJSON object: whether rings, and lists of positions [longitude, latitude, ...].

    Points bound nothing and are left out.
    """
    if not isinstance(node, dict) or "type" not in node:
        raise ValueError("an object has no type, such as FeatureCollection")
    kind = node["type"]
    if kind in ("FeatureCollection", "GeometryCollection"):
        for part in node["features" if kind == "FeatureCollection" else "geometries"]:
            yield from _parts(part)
    elif kind == "Feature":
        if node["geometry"] is not None:
            yield from _parts(node["geometry"])
    elif kind == "LineString":
        yield False, [node["coordinates"]]
    elif kind == "MultiLineString":
        yield from ((False, [line]) for line in node["coordinates"])
    elif kind == "Polygon":
        yield True, node["coordinates"]
    elif kind == "MultiPolygon":
        yield from ((True, polygon) for polygon in node["coordinates"])
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

    Attributes:
        areas: of all obstacles.
    """

    def __init__(self, file: FleetFile, surroundings: Surroundings = OPEN_WATER) -> None:
        self._game_max_age_s = file.limits.game.max_age_s
        rules = [Area("of the rules", (tuple(line),)) for line in surroundings.polygons]
        rules += [Area("of the rules", circle=circle) for circle in surroundings.circles]
        self.areas = (*areas(file.obstacles, file.frame), *rules)
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
