"""Messages of the published Foxglove schemas (https://docs.foxglove.dev, JSON encoding): places, drawings, log lines.

Only the parts of `foxglove.SceneUpdate` that are used are described; readers take the others as empty.
"""

from __future__ import annotations

from typing import Any

from .schemas import FLAG, NUMBER, TEXT, WHOLE, choice, many, named, record

FRAME = "field"
"""Name of the frame: x and y of the field, z up."""

DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4
"""Levels of `foxglove.Log`."""

_TIME = record("time", sec=WHOLE, nsec=WHOLE)
_POINT = record("m", x=NUMBER, y=NUMBER, z=NUMBER)
_TURN = record("quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
_POSE = record("place and direction", position=_POINT, orientation=_TURN)
_COLOR = record("0 to 1", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
_LINE_LOOP = 1

LOG = named(
    "foxglove.Log",
    record(
        "A log message",
        timestamp=_TIME,
        level=choice(UNKNOWN=0, DEBUG=1, INFO=2, WARNING=3, ERROR=4, FATAL=5),
        message=TEXT,
        name=TEXT,
        file=TEXT,
        line=WHOLE,
    ),
)

LOCATION_FIX = named(
    "foxglove.LocationFix",
    record(
        "Where a boat is on earth",
        timestamp=_TIME,
        frame_id=TEXT,
        latitude=NUMBER,
        longitude=NUMBER,
        altitude=NUMBER,
        position_covariance=many(NUMBER),
        position_covariance_type=choice(UNKNOWN=0, APPROXIMATED=1, DIAGONAL_KNOWN=2, KNOWN=3),
    ),
)

_ARROW = record(
    "arrow along +x of its pose",
    pose=_POSE,
    shaft_length=NUMBER,
    shaft_diameter=NUMBER,
    head_length=NUMBER,
    head_diameter=NUMBER,
    color=_COLOR,
)
_CYLINDER = record("disc", pose=_POSE, size=_POINT, bottom_scale=NUMBER, top_scale=NUMBER, color=_COLOR)
_LINE = record(
    "line",
    type=choice(LINE_STRIP=0, LINE_LOOP=1, LINE_LIST=2),
    pose=_POSE,
    thickness=NUMBER,
    scale_invariant=FLAG,
    points=many(_POINT),
    color=_COLOR,
    colors=many(_COLOR),
    indices=many(WHOLE),
)
_TEXT = record(
    "label",
    pose=_POSE,
    billboard=FLAG,
    font_size=NUMBER,
    scale_invariant=FLAG,
    color=_COLOR,
    text=TEXT,
)
_ENTITY = record(
    "what is drawn together",
    timestamp=_TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=_TIME,
    frame_locked=FLAG,
    metadata=many(record("pair", key=TEXT, value=TEXT)),
    arrows=many(_ARROW),
    cylinders=many(_CYLINDER),
    lines=many(_LINE),
    texts=many(_TEXT),
)
_DELETION = record("what is removed", timestamp=_TIME, type=choice(MATCHING_ID=0, ALL=1), id=TEXT)

SCENE_UPDATE = named(
    "foxglove.SceneUpdate",
    record("What is drawn in the 3D panel", deletions=many(_DELETION), entities=many(_ENTITY)),
)

Message = dict[str, Any]
Color = tuple[float, float, float, float]


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
