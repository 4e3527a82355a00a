"""Shore and keep-out areas of a FLEET.yaml, in the field's metres: its own corners, places, or a GeoJSON file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..exceptions import FleetFileError
from .fleet_settings import FleetSettings, Geofence, Obstacle
from .frame import FieldFrame

FORMS = ("polygon_m", "polygon_deg", "circle_m", "geojson")
MOST_EDGES = 400
"""Of all obstacles together: the shield looks at each at every turn."""
FARTHEST_M = 20_000.0
"""An obstacle farther from the geofence is in another water, or its numbers are in another order."""
MOST_BYTES = 4 << 20
"""Of a GeoJSON file."""

Line = tuple[tuple[float, float], ...]


def read_obstacles(fleet: FleetSettings, folder: Path) -> tuple[Obstacle, ...]:
    """The obstacles of a file, those of GeoJSON files as ``polygon_deg``.

    Raises:
        FleetFileError: a GeoJSON file cannot be read or holds no polygon or line.
    """
    found: list[Obstacle] = []
    for number, obstacle in enumerate(fleet.obstacles):
        if obstacle.geojson is None or _form(obstacle, number) != "geojson":
            found.append(obstacle)
            continue
        lines = _geojson_lines(folder / obstacle.geojson, f"obstacles.{number}.geojson")
        found += [obstacle.model_copy(update={"geojson": None, "polygon_deg": line}) for line in lines]
    return tuple(found)


def check_obstacles(fleet: FleetSettings, frame: FieldFrame) -> None:
    """See that each obstacle has one form, lies near the geofence, and that they are not too many.

    Raises:
        FleetFileError: one does not, with its place in the file and the remedy.
    """
    edges = 0
    for number, obstacle in enumerate(fleet.obstacles):
        if _form(obstacle, number) == "circle_m":
            continue
        corners = corners_m(obstacle, frame)
        edges += len(corners)
        far_m = max(_outside_m(fleet.geofence, *corner) for corner in corners)
        if not far_m <= FARTHEST_M:
            raise FleetFileError(
                f"obstacles.{number}: a corner lies {far_m / 1e3:.0f} km from the geofence; give polygon_deg as "
                "[latitude, longitude], GeoJSON as [longitude, latitude], polygon_m in m"
            )
    if edges > MOST_EDGES:
        raise FleetFileError(f"obstacles have {edges} edges, more than {MOST_EDGES}; simplify them")


def corners_m(obstacle: Obstacle, frame: FieldFrame) -> Line:
    """Corners of a polygon, m in the field's frame; none of a circle."""
    if obstacle.polygon_deg is not None:
        return tuple(frame.to_field_m(*place) for place in obstacle.polygon_deg)
    return obstacle.polygon_m or ()


def _form(obstacle: Obstacle, number: int) -> str:
    given = [form for form in FORMS if getattr(obstacle, form) is not None]
    if len(given) != 1:
        raise FleetFileError(
            f"obstacles.{number} has {' and '.join(given) or 'no form'}; give one of {', '.join(FORMS)}"
        )
    return given[0]


def _outside_m(fence: Geofence, x_m: float, y_m: float) -> float:
    outside = max(fence.xmin_m - x_m, x_m - fence.xmax_m), max(fence.ymin_m - y_m, y_m - fence.ymax_m)
    return math.hypot(*(max(0.0, value) for value in outside))


def _geojson_lines(path: Path, key: str) -> list[Line]:
    """Corners (latitude, longitude), deg, of all rings and lines of a file, each a closed polygon."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FleetFileError(f"{key}: {path} is larger than {MOST_BYTES >> 20} MiB; cut it to the water you use")
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise FleetFileError(f"{key}: cannot read {path} ({error}); give a GeoJSON file") from None
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
    if kind == "FeatureCollection":
        for feature in node["features"]:
            yield from _lines(feature)
    elif kind == "Feature":
        if node["geometry"] is not None:
            yield from _lines(node["geometry"])
    elif kind == "GeometryCollection":
        for geometry in node["geometries"]:
            yield from _lines(geometry)
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
    middle = tuple(0.5 * (a + b) for a, b in zip(*places[:2], strict=True))
    whole = [places[0], (middle[0], middle[1]), *places[1:]]
    return tuple(whole + whole[-2:0:-1])
