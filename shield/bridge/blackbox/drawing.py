"""What a log viewer draws of a tick: boats with their radius, what was wanted and sent, field and obstacles."""

from __future__ import annotations

import math

import numpy as np

from ...decision import Decisions, Reason
from ...fleet import LARGEST, Fleet
from ...platforms import layout as L
from ...surroundings import Surroundings
from ..messages import Tick
from . import foxglove as fg
from .foxglove import Message
from .header import LogHeader

_TEAMS = {0: fg.color(0.1, 0.35, 0.9), 1: fg.color(0.85, 0.15, 0.1)}
_OTHER = fg.color(0.4, 0.4, 0.4)
_WANTED = fg.color(0.6, 0.6, 0.6, 0.9)
_SENT = fg.color(0.1, 0.7, 0.2)
_CHANGED = fg.color(1.0, 0.55, 0.0)
_FIXED = fg.color(0.5, 0.5, 0.5)
_ALPHA = 0.15
_SCALE_S = 2.0
"""Command arrows reach as far as the boat would get in so many seconds."""
_LIFETIME_S = 1


def scene_of(tick: Tick, time_ns: int, separation_m: float) -> Message | None:
    """All boats of a tick; None when it has no fleet."""
    if tick.fleet is None:
        return None
    boats = [i for i in range(len(tick.fleet)) if _placed(tick.fleet, i)]
    return fg.scene_update([_boat(tick.fleet, tick.decisions, i, time_ns, separation_m) for i in boats])


def _boat(fleet: Fleet, decisions: Decisions | None, i: int, time_ns: int, separation_m: float) -> Message:
    x_m, y_m, heading_deg = fleet.state[i, L.X], fleet.state[i, L.Y], fleet.state[i, L.HEADING]
    x_m, y_m, heading_rad = float(x_m), float(y_m), math.radians(float(heading_deg))
    paint = _TEAMS.get(int(fleet.team[i]), _OTHER)
    arrows = [fg.arrow(_pose(x_m, y_m, heading_rad, 0.0), 1.5, 0.4, paint)]
    discs, text = [], fleet.names[i]
    if decisions is not None and fleet.controlled[i]:
        arrows += _commands(decisions, i, x_m, y_m)
        discs = [fg.disc(fg.pose(x_m, y_m), separation_m, {**paint, "a": _ALPHA})]
        text = f"{text} {Reason(int(decisions.reason[i])).name} {decisions.certificate_m[i]:.1f} m"
    texts = [fg.label(x_m, y_m, text, paint)]
    return fg.entity(time_ns, fleet.names[i], _LIFETIME_S, arrows=arrows, cylinders=discs, texts=texts)


def _commands(decisions: Decisions, i: int, x_m: float, y_m: float) -> list[Message]:
    """Arrows of the wanted and the sent command, as far as they can be drawn."""
    own_rad = float(decisions.fleet.heading_rad[i])
    changed = bool(decisions.intervened[i])
    arrows = []
    for commands, paint, width_m in (
        (decisions.wanted, _WANTED, 0.25),
        (decisions.sent, _CHANGED if changed else _SENT, 0.15),
    ):
        speed_mps, heading_rad = commands.absolute(i, own_rad)
        if math.isfinite(speed_mps) and math.isfinite(heading_rad) and 0.05 < abs(speed_mps) < 100.0:
            turn_rad = heading_rad if speed_mps > 0.0 else heading_rad + math.pi
            arrows.append(fg.arrow(_pose(x_m, y_m, turn_rad, 0.3), _SCALE_S * abs(speed_mps), width_m, paint))
    return arrows


def field_of(header: LogHeader, surroundings: Surroundings | None, time_ns: int) -> Message:
    """The field, obstacles and circles to keep out of."""
    fixed = header.surroundings if surroundings is None else surroundings
    lines = [fg.outline(list(polygon), _FIXED) for polygon in fixed.polygons]
    if header.field_size_m is not None:
        lines.append(fg.outline(_corners(0.0, 0.0, *header.field_size_m), _OTHER))
    if fixed.field is not None:
        lines.append(fg.outline(_corners(*fixed.field), _CHANGED))
    discs = [
        fg.disc(fg.pose(x_m, y_m), max(radius_m, 0.01), {**_FIXED, "a": 0.3})
        for x_m, y_m, radius_m in (*fixed.circles, *fixed.keep_out, *fixed.stops)
    ]
    return fg.scene_update([fg.entity(time_ns, "field", lines=lines, cylinders=discs)])


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
        found[name] = fg.location_fix(time_ns, latitude_deg, longitude_deg, error_m)
    return found


def _placed(fleet: Fleet, i: int) -> bool:
    """Whether a boat can be drawn; what a broken source says may be anything."""
    return bool((np.abs(fleet.state[i, : L.SPEED + 1]) <= LARGEST).all())


def _pose(x_m: float, y_m: float, heading_rad: float, z_m: float) -> Message:
    """A place with a direction: arrows point along x, headings count clockwise from y."""
    half = 0.5 * (0.5 * math.pi - heading_rad)
    return fg.pose(x_m, y_m, z_m, (math.sin(half), math.cos(half)))


def _corners(xmin_m: float, ymin_m: float, xmax_m: float, ymax_m: float) -> list[tuple[float, float]]:
    return [(xmin_m, ymin_m), (xmax_m, ymin_m), (xmax_m, ymax_m), (xmin_m, ymax_m)]
