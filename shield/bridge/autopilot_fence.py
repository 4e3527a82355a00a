"""The autopilot's own fence as last resort: accepted where no boat of ours gets to by itself.

ArduPilot keeps a circle around home (FENCE_RADIUS) and zones to stay inside of or outside of. Where one of them acts,
it takes the boat away from the shield. It may do so only beyond the hard line (`geofence.beyond_m`) and the way that a
boat stopped there still runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from ..platforms import Platform, step_boat
from ..platforms import layout as L
from ..platforms.limits import cruise
from .fleet_file import FleetFile
from .mavlink.fence import FenceZone
from .mavlink.vehicle import LinkHealth
from .preflight_checks import CheckResult

CIRCLE_TYPE, POLYGON_TYPE = 2, 4
"""Bits of FENCE_TYPE; the first bit is altitude."""
DEFAULTS = {"FENCE_TYPE": 6.0, "FENCE_RADIUS": 150.0, "FENCE_MARGIN": 2.0, "AVOID_ENABLE": 3.0, "AVOID_MARGIN": 2.0}
"""Of ArduPilot Rover, for what was not heard."""
STOPPED_SHARE, LONGEST_STOP_S = 0.02, 120.0
PART_M, MOST_PARTS = 0.05, 100_000
"""A fence's edges are looked at this finely, m, in no more parts; half a part is taken off."""

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
    points = np.array([fleet.frame.to_field_m(*place) for place in zone.places]).reshape(-1, 2)
    if not len(points) or not np.isfinite(points).all():
        return -math.inf
    low, high = np.array(line[:2]), np.array(line[2:])
    if zone.radius_m > 0.0 or len(points) == 1:
        nearest, farthest = np.clip(points[0], low, high), np.where(points[0] < 0.5 * (low + high), high, low)
        if zone.inside:
            return zone.radius_m - math.dist(points[0], farthest)
        return math.dist(points[0], nearest) - zone.radius_m
    before = np.roll(points, 1, axis=0)
    lengths = np.hypot(*(points - before).T)
    parts = 1 + np.minimum(MOST_PARTS, lengths / PART_M).astype(int)
    edge = np.concatenate([np.linspace(a, b, n + 1) for a, b, n in zip(before, points, parts, strict=True)])
    beyond = np.maximum(low - edge, edge - high)
    room = float(np.hypot(*np.maximum(beyond, 0.0).T).min() - 0.5 * (lengths / parts).max())
    (x1, y1), (x2, y2) = before.T, points.T
    crossed = (y1 > low[1]) != (y2 > low[1])
    x = x1[crossed] + (low[1] - y1[crossed]) / (y2 - y1)[crossed] * (x2 - x1)[crossed]
    holds = bool((low[0] < x).sum() % 2)  # a ray from a corner of the hard line crosses the zone an odd number of times
    return room if holds == zone.inside and room > 0.0 else -max(room, -float(beyond.max(axis=1).min()))
