"""The autopilot's own fence as last resort: accepted where no boat of ours gets to by itself.

ArduPilot keeps a circle around home (FENCE_RADIUS) and zones to stay inside of or outside of. Where one of them acts,
it takes the boat away from the shield. It may do so only beyond the hard line (`geofence.beyond_m`) and the way that a
boat stopped there still runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from ..platforms import Platform, step_boat
from ..platforms import layout as L
from ..platforms.limits import cruise
from .fleet_file import FleetFile
from .mavlink.fence import FenceZone, Point
from .mavlink.vehicle import LinkHealth
from .preflight_checks import CheckResult

CIRCLE_TYPE, POLYGON_TYPE = 2, 4
"""Bits of FENCE_TYPE; the first bit is altitude."""
DEFAULTS = {"FENCE_TYPE": 6.0, "FENCE_RADIUS": 150.0, "FENCE_MARGIN": 2.0, "AVOID_ENABLE": 3.0, "AVOID_MARGIN": 2.0}
"""Of ArduPilot Rover, for what was not heard."""
STOPPED_SHARE, LONGEST_STOP_S = 0.02, 120.0

Box = tuple[float, float, float, float]


class Fenced(Protocol):
    """A link to a boat that may have a fence of its own."""

    def health(self) -> LinkHealth:
        """What the link knows of the boat."""


def check_fence(boat: str, fleet: FleetFile, link: Fenced) -> CheckResult:
    """The autopilot's own fence is off, or so far out that no boat of ours gets there before it is stopped.

    Args:
        boat: its name.
        fleet: the file.
        link: to it, once it was asked for parameters and fence.
    """
    health = link.health()
    known, zones, home_deg = health.parameters, health.fence, health.home_deg
    name, off = f"fence:{boat}", "set FENCE_ENABLE to 0"
    if known.get("FENCE_ENABLE", 0.0) == 0.0:
        return CheckResult(name, True, "its own fence is off")
    value = {**DEFAULTS, **known}
    kinds = int(value["FENCE_TYPE"])
    if fleet.geofence.then == "flee":
        text = f"geofence.then is flee, so its own fence (FENCE_ENABLE) may take the boat away: {off}, or then: stop"
        return CheckResult(name, False, text)
    every = list(zones or ()) if kinds & POLYGON_TYPE else []
    if kinds & CIRCLE_TYPE and home_deg is not None:
        every.append(FenceZone(True, (home_deg,), value["FENCE_RADIUS"]))
    if (kinds & POLYGON_TYPE and zones is None) or (kinds & CIRCLE_TYPE and home_deg is None):
        return CheckResult(name, False, f"FENCE_ENABLE is on and its fence cannot be read: {off}, or try again")
    line = hard_line(fleet)
    needed = needed_m(fleet, boat, value)
    room = min((_room_m(zone, line, fleet) for zone in every), default=math.inf)
    figures = {"fence_room_m": room, "fence_needed_m": needed}
    if not room >= needed:
        where = f"{room:.1f} m outside" if room >= 0.0 else f"{-room:.1f} m inside"
        text = (
            f"its own fence lies {where} the hard line (geofence.beyond_m {fleet.geofence.beyond_m:g}), and the boat "
            f"needs {needed:.1f} m to stop: move the fence out by {needed - room:.1f} m, or {off}"
        )
        return CheckResult(name, False, text, figures)
    if math.isinf(room):
        return CheckResult(name, True, "its own fence is on and has no zones")
    text = f"its own fence lies at least {room:.1f} m outside the hard line, {needed:.1f} m needed to stop"
    return CheckResult(name, True, text, figures)


def hard_line(fleet: FleetFile) -> Box:
    """The rectangle beyond which boats are stopped, m."""
    xmin, ymin, xmax, ymax = fleet.geofence.box
    out = fleet.geofence.beyond_m
    return xmin - out, ymin - out, xmax + out, ymax + out


def needed_m(fleet: FleetFile, boat: str, value: Mapping[str, float]) -> float:
    """How far a fence must lie outside the hard line: the way to stop, the delay's, and where the autopilot slows."""
    platform, config = fleet.platform_of[boat], fleet.shield_config
    acts_m = max(value["FENCE_MARGIN"], value["AVOID_MARGIN"] if int(value["AVOID_ENABLE"]) & 1 else 0.0)
    return stopping_way_m(platform) + platform.max_speed_mps * (config.delay_s + config.dt_s) + acts_m


def stopping_way_m(platform: Platform) -> float:
    """Way from top speed to rest in the boat's own model, m."""
    params, row = cruise(platform)
    for _ in range(round(LONGEST_STOP_S / 0.1)):
        if row[L.SPEED] <= STOPPED_SHARE * platform.max_speed_mps:
            break
        step_boat(params, row, 0.0, 0.0, 0.1)
    return float(np.hypot(row[L.X], row[L.Y]))


def _room_m(zone: FenceZone, line: Box, fleet: FleetFile) -> float:
    """How far a zone's edge lies outside the hard line, m; negative: it cuts into it, or is on its wrong side."""
    points = [fleet.frame.to_field_m(*place) for place in zone.places]
    if not all(math.isfinite(value) for point in points for value in point) or not points:
        return -math.inf
    corners = [(line[0], line[1]), (line[2], line[1]), (line[2], line[3]), (line[0], line[3])]
    if zone.radius_m > 0.0 or len(points) == 1:
        far = [math.dist(points[0], corner) for corner in corners]
        return zone.radius_m - max(far) if zone.inside else _to_box_m(points[0], line) - zone.radius_m
    edges = [(points[k - 1], points[k]) for k in range(len(points))]
    room = min(_apart_m(edge, line, corners) for edge in edges)
    holds = _holds(points, corners[0])
    return room if holds == zone.inside and room > 0.0 else -max(room, *(_depth_m(point, line) for point in points))


def _to_box_m(point: Point, line: Box) -> float:
    return math.hypot(
        max(line[0] - point[0], 0.0, point[0] - line[2]), max(line[1] - point[1], 0.0, point[1] - line[3])
    )


def _depth_m(point: Point, line: Box) -> float:
    """How far a point is inside the box, m; 0 outside."""
    return max(0.0, min(point[0] - line[0], line[2] - point[0], point[1] - line[1], line[3] - point[1]))


def _apart_m(edge: tuple[Point, Point], line: Box, corners: Sequence[Point]) -> float:
    """Distance of an edge from the box, m; 0: it touches it or runs through."""
    sides = [(corners[k - 1], corners[k]) for k in range(4)]
    if any(_to_box_m(point, line) == 0.0 for point in edge) or any(_cross(edge, side) for side in sides):
        return 0.0
    return min(*(_to_box_m(point, line) for point in edge), *(_to_edge_m(corner, edge) for corner in corners))


def _to_edge_m(point: Point, edge: tuple[Point, Point]) -> float:
    a, along = np.array(edge[0]), np.subtract(edge[1], edge[0])
    length = float(along @ along)
    share = 0.0 if length == 0.0 else float(np.clip((np.array(point) - a) @ along / length, 0.0, 1.0))
    return float(np.hypot(*(np.array(point) - a - share * along)))


def _cross(one: tuple[Point, Point], other: tuple[Point, Point]) -> bool:
    def side(a: Point, b: Point, c: Point) -> float:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    apart_one = side(*one, other[0]) * side(*one, other[1])
    return apart_one < 0.0 and side(*other, one[0]) * side(*other, one[1]) < 0.0


def _holds(polygon: Sequence[Point], point: Point) -> bool:
    """Whether a polygon holds a point: rays cross its edges an odd number of times."""
    holds = False
    for k in range(len(polygon)):
        (x1, y1), (x2, y2) = polygon[k - 1], polygon[k]
        if (y1 > point[1]) != (y2 > point[1]) and point[0] < x1 + (point[1] - y1) / (y2 - y1) * (x2 - x1):
            holds = not holds
    return holds
