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

FRAME = "field"
"""Name of the frame: x and y of the field, z up."""
DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4
"""Levels of `foxglove.Log`."""
_LINE_LOOP = 1

SCHEMAS: dict[str, dict[str, Any]] = json.loads(files(__package__).joinpath("foxglove_schemas.json").read_text("utf-8"))
"""https://docs.foxglove.dev, by name."""
LOG, LOCATION_FIX, SCENE_UPDATE = (SCHEMAS[name] for name in ("LOG", "LOCATION_FIX", "SCENE_UPDATE"))

Message = dict[str, Any]


def time_of(time_ns: int) -> Message:
    """A time as seconds and nanoseconds."""
    return {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}


def log_message(time_ns: int, level: int, name: str, text: str) -> Message:
    """A `foxglove.Log`."""
    return {"timestamp": time_of(time_ns), "level": level, "message": text, "name": name, "file": "", "line": 0}


def location_fix(time_ns: int, latitude_deg: float, longitude_deg: float, error_m: float) -> Message:
    """A `foxglove.LocationFix`; the position's error bound is taken for its spread."""
    covariance = [0.0] * 9
    covariance[0] = covariance[4] = error_m * error_m
    return {
        "timestamp": time_of(time_ns),
        "frame_id": FRAME,
        "latitude": latitude_deg,
        "longitude": longitude_deg,
        "altitude": 0.0,
        "position_covariance": covariance,
        "position_covariance_type": 1,
    }


def scene_update(entities: list[Message]) -> Message:
    """A `foxglove.SceneUpdate` that replaces what has the same names."""
    return {"deletions": [], "entities": entities}


def entity(time_ns: int, name: str, lifetime_s: int = 0, **parts: list[Message]) -> Message:
    """One thing drawn, of ``arrows``, ``cylinders``, ``lines`` and ``texts``; lifetime 0: until replaced."""
    empty: Message = {
        kind: []
        for kind in ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models", "metadata")
    }
    head = {
        "timestamp": time_of(time_ns),
        "frame_id": FRAME,
        "id": name,
        "lifetime": {"sec": lifetime_s, "nsec": 0},
        "frame_locked": False,
    }
    return head | empty | parts


def color(red: float, green: float, blue: float, alpha: float = 1.0) -> Message:
    """A colour, parts 0 to 1."""
    return {"r": red, "g": green, "b": blue, "a": alpha}


def pose(x_m: float, y_m: float, z_m: float = 0.0, turn: tuple[float, float] = (0.0, 1.0)) -> Message:
    """A place, with ``turn`` the sine and cosine of half the angle about z."""
    return {
        "position": {"x": x_m, "y": y_m, "z": z_m},
        "orientation": {"x": 0.0, "y": 0.0, "z": turn[0], "w": turn[1]},
    }


def arrow(where: Message, length_m: float, width_m: float, paint: Message) -> Message:
    """An arrow of that length and shaft width; its head is a third of it."""
    head_m = min(length_m / 3.0, 2.0 * width_m)
    return {
        "pose": where,
        "shaft_length": length_m - head_m,
        "shaft_diameter": width_m,
        "head_length": head_m,
        "head_diameter": 2.0 * width_m,
        "color": paint,
    }


def disc(where: Message, radius_m: float, paint: Message) -> Message:
    """A flat disc."""
    size = {"x": 2.0 * radius_m, "y": 2.0 * radius_m, "z": 0.02}
    return {"pose": where, "size": size, "bottom_scale": 1.0, "top_scale": 1.0, "color": paint}


def outline(points: list[tuple[float, float]], paint: Message) -> Message:
    """A closed line, 2 pixels wide, through points x, y m."""
    return {
        "type": _LINE_LOOP,
        "pose": pose(0.0, 0.0),
        "thickness": 2.0,
        "scale_invariant": True,
        "points": [{"x": x, "y": y, "z": 0.0} for x, y in points],
        "color": paint,
        "colors": [],
        "indices": [],
    }


def label(x_m: float, y_m: float, text: str, paint: Message) -> Message:
    """A text of 12 pixels that faces the viewer."""
    return {
        "pose": pose(x_m, y_m, 1.0),
        "billboard": True,
        "font_size": 12.0,
        "scale_invariant": True,
        "color": paint,
        "text": text,
    }


_TEAMS = {0: color(0.1, 0.35, 0.9), 1: color(0.85, 0.15, 0.1)}
_OTHER = color(0.4, 0.4, 0.4)
_WANTED = color(0.6, 0.6, 0.6, 0.9)
_SENT = color(0.1, 0.7, 0.2)
_CHANGED = color(1.0, 0.55, 0.0)
_FIXED = color(0.5, 0.5, 0.5)
_ALPHA = 0.15
_SCALE_S = 2.0
"""Command arrows reach as far as the boat would get in so many seconds."""
_LIFETIME_S = 1


def scene_of(tick: Tick, time_ns: int, separation_m: float) -> Message | None:
    """All boats of a tick; None when it has no fleet."""
    if tick.fleet is None:
        return None
    boats = [i for i in range(len(tick.fleet)) if _placed(tick.fleet, i)]
    return scene_update([_boat(tick.fleet, tick.decisions, i, time_ns, separation_m) for i in boats])


def _boat(fleet: Fleet, decisions: Decisions | None, i: int, time_ns: int, separation_m: float) -> Message:
    x_m, y_m, heading_deg = fleet.state[i, L.X], fleet.state[i, L.Y], fleet.state[i, L.HEADING]
    x_m, y_m, heading_rad = float(x_m), float(y_m), math.radians(float(heading_deg))
    paint = _TEAMS.get(int(fleet.team[i]), _OTHER)
    arrows = [arrow(_pose(x_m, y_m, heading_rad, 0.0), 1.5, 0.4, paint)]
    discs, text = [], fleet.names[i]
    if decisions is not None and fleet.controlled[i]:
        arrows += _commands(decisions, i, x_m, y_m)
        discs = [disc(pose(x_m, y_m), separation_m, {**paint, "a": _ALPHA})]
        text = f"{text} {Reason(int(decisions.reason[i])).name} {decisions.safety_margin_m[i]:.1f} m"
    texts = [label(x_m, y_m, text, paint)]
    return entity(time_ns, fleet.names[i], _LIFETIME_S, arrows=arrows, cylinders=discs, texts=texts)


def _commands(decisions: Decisions, i: int, x_m: float, y_m: float) -> list[Message]:
    """Arrows of the wanted and the sent command, as far as they can be drawn."""
    own_rad = float(decisions.fleet.heading_rad[i])
    changed = bool(decisions.intervened[i])
    arrows = []
    for commands, paint, width_m in (
        (decisions.nominal, _WANTED, 0.25),
        (decisions.filtered, _CHANGED if changed else _SENT, 0.15),
    ):
        speed_mps, heading_rad = commands.absolute(i, own_rad)
        if math.isfinite(speed_mps) and math.isfinite(heading_rad) and 0.05 < abs(speed_mps) < 100.0:
            turn_rad = heading_rad if speed_mps > 0.0 else heading_rad + math.pi
            arrows.append(arrow(_pose(x_m, y_m, turn_rad, 0.3), _SCALE_S * abs(speed_mps), width_m, paint))
    return arrows


def field_of(header: LogHeader, surroundings: Surroundings | None, time_ns: int) -> Message:
    """The field, obstacles and circles to keep out of."""
    fixed = header.surroundings if surroundings is None else surroundings
    lines = [outline(list(polygon), _FIXED) for polygon in fixed.polygons]
    if header.field_size_m is not None:
        lines.append(outline(_corners(0.0, 0.0, *header.field_size_m), _OTHER))
    if fixed.field is not None:
        lines.append(outline(_corners(*fixed.field), _CHANGED))
    discs = [
        disc(pose(x_m, y_m), max(radius_m, 0.01), {**_FIXED, "a": 0.3})
        for x_m, y_m, radius_m in (*fixed.circles, *fixed.keep_out, *fixed.stops)
    ]
    return scene_update([entity(time_ns, "field", lines=lines, cylinders=discs)])


def fixes_of(tick: Tick, header: LogHeader, time_ns: int) -> dict[str, Message]:
    """Latitude and longitude of each boat, by name; none when the field is nowhere on earth."""
    if header.frame is None or tick.fleet is None:
        return {}
    fleet, found = tick.fleet, {}
    error = fleet.position_error_m
    for i, name in enumerate(fleet.names):
        if not _placed(fleet, i):
            continue
        latitude_deg, longitude_deg = header.frame.to_geodetic_deg(
            float(fleet.state[i, L.X]), float(fleet.state[i, L.Y])
        )
        error_m = header.config.position_error_m if error is None else float(error[i])
        found[name] = location_fix(time_ns, latitude_deg, longitude_deg, error_m)
    return found


def _placed(fleet: Fleet, i: int) -> bool:
    """Whether a boat can be drawn; what a broken source says may be anything."""
    return bool((np.abs(fleet.state[i, : L.SPEED + 1]) <= LARGEST).all())


def _pose(x_m: float, y_m: float, heading_rad: float, z_m: float) -> Message:
    """A place with a direction: arrows point along x, headings count clockwise from y."""
    half = 0.5 * (0.5 * math.pi - heading_rad)
    return pose(x_m, y_m, z_m, (math.sin(half), math.cos(half)))


def _corners(xmin_m: float, ymin_m: float, xmax_m: float, ymax_m: float) -> list[tuple[float, float]]:
    return [(xmin_m, ymin_m), (xmax_m, ymin_m), (xmax_m, ymax_m), (xmin_m, ymax_m)]
