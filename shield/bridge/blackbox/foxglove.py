"""What a log viewer draws of a tick, in messages of the published Foxglove schemas (JSON encoding).

Only the parts of `foxglove.SceneUpdate` that are used are described; readers take the others as empty.
"""

from __future__ import annotations

import json
import math
from importlib.resources import files
from typing import Any

import numpy as np

from ...decision import Decisions, Reason
from ...fleet import LARGEST, Fleet
from ...platforms import layout as L
from ...surroundings import Surroundings
from ..messages import Tick
from .header import LogHeader

Message = dict[str, Any]
Color = tuple[float, float, float, float]  # red, green, blue and alpha, 0 to 1

FRAME = "field"  # name of the frame: x and y of the field, z up
DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4  # levels of `foxglove.Log`
SCHEMAS: dict[str, Message] = json.loads(files(__package__).joinpath("foxglove_schemas.json").read_text("utf-8"))
"""https://docs.foxglove.dev, by name."""
LOG, LOCATION_FIX, SCENE_UPDATE = (SCHEMAS[name] for name in ("LOG", "LOCATION_FIX", "SCENE_UPDATE"))

_TEAMS: dict[int, Color] = {0: (0.1, 0.35, 0.9, 1.0), 1: (0.85, 0.15, 0.1, 1.0)}
_OTHER: Color = (0.4, 0.4, 0.4, 1.0)
_NOMINAL: Color = (0.6, 0.6, 0.6, 0.9)
_FILTERED: Color = (0.1, 0.7, 0.2, 1.0)
_CHANGED: Color = (1.0, 0.55, 0.0, 1.0)
_FIXED: Color = (0.5, 0.5, 0.5, 1.0)
_SCALE_S, _LIFETIME_S = 2.0, 1  # command arrows reach as far as the boat would get in so many seconds
_PARTS = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models", "metadata")


def log_message(time_ns: int, level: int, name: str, text: str) -> Message:
    """A `foxglove.Log`."""
    return {"timestamp": _time(time_ns), "level": level, "message": text, "name": name, "file": "", "line": 0}


def scene_of(tick: Tick, time_ns: int, separation_m: float) -> Message | None:
    """All boats of a tick, as a `foxglove.SceneUpdate`; None when it has no fleet."""
    fleet = tick.fleet
    if fleet is None:
        return None
    return _scene([_boat(fleet, tick.decisions, i, time_ns, separation_m) for i in _placed(fleet)])


def field_of(header: LogHeader, surroundings: Surroundings | None, time_ns: int) -> Message:
    """The field, obstacles and circles to keep out of, as a `foxglove.SceneUpdate`."""
    fixed = header.surroundings if surroundings is None else surroundings
    lines = [_outline(list(polygon), _FIXED) for polygon in fixed.polygons]
    if header.field_size_m is not None:
        lines.append(_outline(_corners(0.0, 0.0, *header.field_size_m), _OTHER))
    if fixed.field is not None:
        lines.append(_outline(_corners(*fixed.field), _CHANGED))
    discs = [
        _disc(x_m, y_m, max(radius_m, 0.01), (*_FIXED[:3], 0.3))
        for x_m, y_m, radius_m in (*fixed.circles, *fixed.keep_out, *fixed.stops)
    ]
    return _scene([_entity(time_ns, "field", 0, lines=lines, cylinders=discs)])


def fixes_of(tick: Tick, header: LogHeader, time_ns: int) -> dict[str, Message]:
    """A `foxglove.LocationFix` of each boat, by name; none when the field is nowhere on earth.

    The position's error bound is taken for its spread.
    """
    fleet, found = tick.fleet, {}
    if header.frame is None or fleet is None:
        return {}
    for i in _placed(fleet):
        latitude_deg, longitude_deg = header.frame.to_geodetic_deg(*fleet.state[i, : L.Y + 1].tolist())
        error = header.config.position_error_m if fleet.position_error_m is None else float(fleet.position_error_m[i])
        found[fleet.names[i]] = {
            "timestamp": _time(time_ns),
            "frame_id": FRAME,
            "latitude": latitude_deg,
            "longitude": longitude_deg,
            "altitude": 0.0,
            "position_covariance": [error * error, 0.0, 0.0, 0.0, error * error, 0.0, 0.0, 0.0, 0.0],
            "position_covariance_type": 1,
        }
    return found


def _boat(fleet: Fleet, decisions: Decisions | None, i: int, time_ns: int, separation_m: float) -> Message:
    x_m, y_m = fleet.state[i, : L.Y + 1].tolist()
    paint = _TEAMS.get(int(fleet.team[i]), _OTHER)
    arrows = [_arrow((x_m, y_m, 0.0), float(fleet.heading_rad[i]), 1.5, 0.4, paint)]
    discs, text = [], fleet.names[i]
    if decisions is not None and fleet.controlled[i]:
        arrows += _commands(decisions, i, x_m, y_m)
        discs = [_disc(x_m, y_m, separation_m, (*paint[:3], 0.15))]
        text = f"{text} {Reason(int(decisions.reason[i])).name} {decisions.safety_margin_m[i]:.1f} m"
    label = {
        "pose": _pose(x_m, y_m, 1.0),
        "billboard": True,
        "font_size": 12.0,
        "scale_invariant": True,
        "color": _color(paint),
        "text": text,
    }
    return _entity(time_ns, fleet.names[i], _LIFETIME_S, arrows=arrows, cylinders=discs, texts=[label])


def _commands(decisions: Decisions, i: int, x_m: float, y_m: float) -> list[Message]:
    """Arrows of the nominal and the filtered command, as far as they can be drawn."""
    arrows = []
    for commands, paint, width_m in (
        (decisions.nominal, _NOMINAL, 0.25),
        (decisions.filtered, _CHANGED if decisions.intervened[i] else _FILTERED, 0.15),
    ):
        speed_mps, heading_rad = commands.absolute(i, float(decisions.fleet.heading_rad[i]))
        if math.isfinite(speed_mps) and math.isfinite(heading_rad) and 0.05 < abs(speed_mps) < 100.0:
            turn_rad = heading_rad if speed_mps > 0.0 else heading_rad + math.pi
            arrows.append(_arrow((x_m, y_m, 0.3), turn_rad, _SCALE_S * abs(speed_mps), width_m, paint))
    return arrows


def _placed(fleet: Fleet) -> list[int]:
    """Boats that can be drawn; what a broken source says may be anything."""
    return np.flatnonzero((np.abs(fleet.state[:, : L.SPEED + 1]) <= LARGEST).all(axis=1)).tolist()


def _time(time_ns: int) -> Message:
    return {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}


def _scene(entities: list[Message]) -> Message:
    """Replaces what has the same names."""
    return {"deletions": [], "entities": entities}


def _entity(time_ns: int, name: str, lifetime_s: int, **parts: list[Message]) -> Message:
    """One thing drawn; lifetime 0: until replaced."""
    head = {
        "timestamp": _time(time_ns),
        "frame_id": FRAME,
        "id": name,
        "lifetime": {"sec": lifetime_s, "nsec": 0},
        "frame_locked": False,
    }
    return head | {kind: parts.get(kind, []) for kind in _PARTS}


def _color(paint: Color) -> Message:
    return dict(zip("rgba", paint, strict=True))


def _pose(x_m: float, y_m: float, z_m: float = 0.0, heading_rad: float = 0.5 * math.pi) -> Message:
    """A place with a direction: arrows point along x, headings count clockwise from y."""
    half = 0.5 * (0.5 * math.pi - heading_rad)
    return {
        "position": {"x": x_m, "y": y_m, "z": z_m},
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
    }


def _arrow(
    at: tuple[float, float, float], heading_rad: float, length_m: float, width_m: float, paint: Color
) -> Message:
    """An arrow of that length and shaft width; its head is a third of it."""
    head_m = min(length_m / 3.0, 2.0 * width_m)
    return {
        "pose": _pose(*at, heading_rad),
        "shaft_length": length_m - head_m,
        "shaft_diameter": width_m,
        "head_length": head_m,
        "head_diameter": 2.0 * width_m,
        "color": _color(paint),
    }


def _disc(x_m: float, y_m: float, radius_m: float, paint: Color) -> Message:
    size = {"x": 2.0 * radius_m, "y": 2.0 * radius_m, "z": 0.02}
    return {"pose": _pose(x_m, y_m), "size": size, "bottom_scale": 1.0, "top_scale": 1.0, "color": _color(paint)}


def _outline(points: list[tuple[float, float]], paint: Color) -> Message:
    """A closed line, 2 pixels wide."""
    return {
        "type": 1,  # a loop
        "pose": _pose(0.0, 0.0),
        "thickness": 2.0,
        "scale_invariant": True,
        "points": [{"x": x, "y": y, "z": 0.0} for x, y in points],
        "color": _color(paint),
        "colors": [],
        "indices": [],
    }


def _corners(xmin_m: float, ymin_m: float, xmax_m: float, ymax_m: float) -> list[tuple[float, float]]:
    return [(xmin_m, ymin_m), (xmax_m, ymin_m), (xmax_m, ymax_m), (xmin_m, ymax_m)]
