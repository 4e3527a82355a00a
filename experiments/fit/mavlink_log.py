"""MAVLink telemetry logs (``.tlog``) and ArduPilot's own logs (``.bin``), read with pymavlink."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import FitError
from .runs import Run
from .streams import Streams

EARTH_M = 6378137.0
TLOG_NAMES = {
    "x": "GLOBAL_POSITION_INT",
    "y": "GLOBAL_POSITION_INT",
    "heading": "ATTITUDE or GLOBAL_POSITION_INT",
    "speed": "GLOBAL_POSITION_INT",
    "told_speed": "SET_ATTITUDE_TARGET with the parameter WP_SPEED, or SET_POSITION_TARGET_LOCAL_NED",
    "told_heading": "SET_ATTITUDE_TARGET or SET_POSITION_TARGET_LOCAL_NED",
}
BIN_NAMES = {
    "x": "POS",
    "y": "POS",
    "heading": "ATT.Yaw",
    "speed": "GPS.Spd",
    "told_speed": "THR.DesSpeed",
    "told_heading": "NTUN.DesYaw",
}
MASK_IGNORES_RATES = 7
MASK_VELOCITY_ONLY = 3527


def read_tlog(path: Path, system_id: int | None) -> list[Run]:
    """Runs of one boat of a telemetry log.

    Raises:
        FitError: it is none, tells too little, or tells of several boats and none was named.
    """
    boats: dict[int, _Boat] = {}
    commands: list[Any] = []
    for message in _messages(path):
        kind = message.get_type()
        if kind in ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED"):
            commands.append(message)
        elif kind in ("GLOBAL_POSITION_INT", "ATTITUDE", "PARAM_VALUE"):
            boats.setdefault(message.get_srcSystem(), _Boat()).take(message)
    boats = {number: boat for number, boat in boats.items() if boat.origin is not None}
    number = _chosen(path, sorted(boats), system_id)
    boat = boats[number]
    for message in commands:
        if message.target_system in (0, number):
            boat.command(message)
    return boat.streams.runs(path.stem, TLOG_NAMES)


def _chosen(path: Path, numbers: list[int], system_id: int | None) -> int:
    if not numbers:
        raise FitError(f"{path.name} tells no positions (GLOBAL_POSITION_INT); give a log of a boat's telemetry")
    if system_id is None and len(numbers) > 1:
        known = ", ".join(map(str, numbers))
        raise FitError(f"{path.name} tells of boats {known}; name one with --system-id")
    number = numbers[0] if system_id is None else system_id
    if number not in numbers:
        raise FitError(f"{path.name} tells nothing of boat {number}; it has {', '.join(map(str, numbers))}")
    return number


class _Boat:
    """What a log tells of one boat."""

    def __init__(self) -> None:
        self.streams = Streams()
        self.origin: tuple[float, float] | None = None
        self.top_mps = math.nan
        self.has_attitude = False

    def take(self, message: Any) -> None:
        time_s, kind = float(message._timestamp), message.get_type()
        if kind == "PARAM_VALUE":
            if message.param_id.rstrip("\0") == "WP_SPEED":
                self.top_mps = float(message.param_value)
        elif kind == "ATTITUDE":
            self.has_attitude = True
            self.streams.add("heading", time_s, math.degrees(message.yaw))
        else:
            self._position(time_s, message.lat / 1e7, message.lon / 1e7)
            north, east = message.vx / 100.0, message.vy / 100.0
            heading = math.radians(message.hdg / 100.0)
            if not self.has_attitude and message.hdg != 65535:
                self.streams.add("heading", time_s, math.degrees(heading))
            self.streams.add("speed", time_s, north * math.cos(heading) + east * math.sin(heading))

    def _position(self, time_s: float, latitude_deg: float, longitude_deg: float) -> None:
        if self.origin is None:
            self.origin = latitude_deg, longitude_deg
        x, y = place_m(self.origin, latitude_deg, longitude_deg)
        self.streams.add("x", time_s, x)
        self.streams.add("y", time_s, y)

    def command(self, message: Any) -> None:
        time_s = float(message._timestamp)
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            if message.type_mask == MASK_VELOCITY_ONLY:
                self.streams.add_velocity_told(time_s, message.vy, message.vx)
        elif message.type_mask == MASK_IGNORES_RATES and math.isfinite(self.top_mps):
            w, x, y, z = message.q
            yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            self.streams.add("told_heading", time_s, math.degrees(yaw))
            self.streams.add("told_speed", time_s, message.thrust * self.top_mps)


def place_m(origin: tuple[float, float], latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """East and north of an origin, m, on the sphere: over a log's few hundred metres as good as the ellipsoid."""
    north = math.radians(latitude_deg - origin[0]) * EARTH_M
    return math.radians(longitude_deg - origin[1]) * EARTH_M * math.cos(math.radians(origin[0])), north


def read_bin(path: Path) -> list[Run]:
    """Runs of an ArduPilot log.

    Raises:
        FitError: it is none, or it tells too little.
    """
    streams, origin = Streams(), None
    for message in _messages(path):
        kind = message.get_type()
        time_s = float(getattr(message, "TimeUS", 0)) / 1e6
        if kind == "POS":
            origin = origin or (message.Lat, message.Lng)
            x, y = place_m(origin, message.Lat, message.Lng)
            streams.add("x", time_s, x)
            streams.add("y", time_s, y)
        for what, name in BIN_NAMES.items():
            source, _, field = name.partition(".")
            if kind == source and field:
                if not hasattr(message, field):
                    raise FitError(f"{path.name}: its {kind} messages have no {field}; give a log of ArduPilot Rover 4")
                streams.add(what, time_s, float(getattr(message, field)))
    return streams.runs(path.stem, BIN_NAMES)


def _messages(path: Path) -> Iterator[Any]:
    os.environ.setdefault("MAVLINK20", "1")
    from pymavlink import mavutil

    try:
        log = mavutil.mavlink_connection(str(path), robust_parsing=True)
        while True:
            message = log.recv_match()
            if message is None:
                break
            yield message
        log.close()
    except FitError:
        raise
    except Exception as error:  # pymavlink raises whatever its parsers stumble over
        raise FitError(f"{path.name} cannot be read as {path.suffix} ({error}); give an unbroken log") from None
