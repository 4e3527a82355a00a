"""MAVLink telemetry logs (``.tlog``) and ArduPilot's own logs (``.bin``), read with pymavlink."""

from __future__ import annotations

import math
import os
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .runs import FitError, Run
from .streams import Streams, Tell, untold

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
BIN_FIELDS = {name.partition(".")[0]: (what, name.partition(".")[2]) for what, name in BIN_NAMES.items() if "." in name}
MASK_IGNORES_RATES = 7
MASK_VELOCITY_ONLY = 3527
COMMANDS = ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED")
TOP_SPEED = ("WP_SPEED", "CRUISE_SPEED")
"""Parameters of which ArduPilot Rover takes the first that is not 0 for the speed that thrust is a share of."""
FIX_3D = 3


def read_tlog(path: Path, system_id: int | None, tell: Tell = untold) -> list[Run]:
    """Read one boat of a telemetry log.

    Raises:
        FitError: it is none, tells too little, or tells of several boats and none was named.
    """
    kept = [message for message in _messages(path) if message.get_type() in (*COMMANDS, *_Boat.TELLS)]
    sources = Counter(_source(m) for m in kept if m.get_type() == "GLOBAL_POSITION_INT" and _is_place(m.lat, m.lon))
    number = _chosen(path, sorted({system for system, _ in sources}), system_id)
    component = max((count, -component) for (system, component), count in sources.items() if system == number)[1]
    boat = _Boat(Streams(path.stem, tell), [m for m in kept if _source(m) == (number, -component)])
    for message in kept:
        boat.streams.clock(float(message._timestamp))
        if message.get_type() in COMMANDS:
            if message.target_system in (0, number):
                boat.command(message)
        elif _source(message) == (number, -component):
            boat.take(message)
    return boat.streams.runs(TLOG_NAMES)


def _source(message: Any) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


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
    """What a log tells of one boat; ``said`` is all that it said itself."""

    TELLS = ("GLOBAL_POSITION_INT", "ATTITUDE", "PARAM_VALUE")

    def __init__(self, streams: Streams, said: Sequence[Any]) -> None:
        self.streams = streams
        self._origin = _middle([(m.lat, m.lon) for m in said if m.get_type() == "GLOBAL_POSITION_INT"])
        self._has_attitude = any(m.get_type() == "ATTITUDE" for m in said)
        self._heading_deg = math.nan
        self._tops: dict[str, list[tuple[float, float]]] = {name: [] for name in TOP_SPEED}
        for message in said:
            if message.get_type() == "PARAM_VALUE" and (name := message.param_id.rstrip("\0")) in self._tops:
                self._tops[name].append((float(message._timestamp), float(message.param_value)))

    def take(self, message: Any) -> None:
        time_s, kind = float(message._timestamp), message.get_type()
        if kind == "ATTITUDE":
            self._heading_deg = math.degrees(message.yaw)
            self.streams.add("heading", time_s, self._heading_deg)
        elif kind == "GLOBAL_POSITION_INT" and _is_place(message.lat, message.lon):
            if message.hdg != 65535 and not self._has_attitude:
                self._heading_deg = message.hdg / 100.0
                self.streams.add("heading", time_s, self._heading_deg)
            x, y = place_m(self._origin, message.lat / 1e7, message.lon / 1e7)
            self.streams.add("x", time_s, x)
            self.streams.add("y", time_s, y)
            heading = math.radians(message.hdg / 100.0 if message.hdg != 65535 else self._heading_deg)
            self.streams.add("speed", time_s, (message.vx * math.cos(heading) + message.vy * math.sin(heading)) / 100.0)

    def command(self, message: Any) -> None:
        time_s = float(message._timestamp)
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            if message.type_mask == MASK_VELOCITY_ONLY:
                self.streams.add_velocity_told(time_s, message.vy, message.vx)
        elif message.type_mask == MASK_IGNORES_RATES and math.isfinite(top_mps := self._top_mps(time_s)):
            w, x, y, z = message.q
            yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            self.streams.add("told_heading", time_s, math.degrees(yaw))
            self.streams.add("told_speed", time_s, message.thrust * top_mps)

    def _top_mps(self, time_s: float) -> float:
        """Speed of full thrust at a time; before it was first told only if it is the same all along, else NaN."""
        for told in self._tops.values():
            at = bisect_right([when_s for when_s, _ in told], time_s)
            known = told[at - 1 : at] or (told[:1] if len({value for _, value in told}) == 1 else [])
            if not known and told:
                return math.nan
            if known and known[0][1] > 0.0:
                return known[0][1]
        return math.nan


def _is_place(latitude: int, longitude: int) -> bool:
    """Whether it is one, in 1e-7 deg: ArduPilot sends 0, 0 until it has a fix."""
    return (latitude, longitude) != (0, 0) and abs(latitude) <= 900_000_000 and abs(longitude) <= 1_800_000_000


def _middle(places: Sequence[tuple[int, int]]) -> tuple[float, float]:
    """The median place, deg, of places in 1e-7 deg: no single odd one is the origin."""
    fine = [place for place in places if _is_place(*place)]
    latitude, longitude = np.median(np.array(fine), axis=0) / 1e7 if fine else (math.nan, math.nan)
    return float(latitude), float(longitude)


def place_m(origin: tuple[float, float], latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """East and north of an origin, m, on the sphere: over a log's few hundred metres as good as the ellipsoid."""
    north = math.radians(latitude_deg - origin[0]) * EARTH_M
    return math.radians(longitude_deg - origin[1]) * EARTH_M * math.cos(math.radians(origin[0])), north


def read_bin(path: Path, tell: Tell = untold) -> list[Run]:
    """Read an ArduPilot log; of several GPS receivers the one that most often has a fix.

    Raises:
        FitError: it is none, or it tells too little.
    """
    kept = [message for message in _messages(path) if message.get_type() in ("POS", *BIN_FIELDS)]
    origin = _middle([_raw_place(m) for m in kept if m.get_type() == "POS"])
    receivers = Counter(getattr(m, "I", 0) for m in kept if m.get_type() == "GPS" and _has_fix(m))
    receiver = max(receivers, key=lambda number: (receivers[number], -number), default=0)
    streams = Streams(path.stem, tell)
    for message in kept:
        kind, time_s = message.get_type(), float(getattr(message, "TimeUS", math.nan)) / 1e6
        if math.isnan(time_s):
            raise FitError(f"{path.name}: its {kind} messages have no TimeUS; give a log of ArduPilot Rover 4")
        streams.clock(time_s)
        if kind == "POS":
            if _is_place(*_raw_place(message)):
                x, y = place_m(origin, message.Lat, message.Lng)
                streams.add("x", time_s, x)
                streams.add("y", time_s, y)
        elif kind != "GPS" or (_has_fix(message) and getattr(message, "I", 0) == receiver):
            what, field = BIN_FIELDS[kind]
            if not hasattr(message, field):
                raise FitError(f"{path.name}: its {kind} messages have no {field}; give a log of ArduPilot Rover 4")
            streams.add(what, time_s, float(getattr(message, field)))
    return streams.runs(BIN_NAMES, sampled=True)


def _raw_place(message: Any) -> tuple[int, int]:
    return round(message.Lat * 1e7), round(message.Lng * 1e7)


def _has_fix(message: Any) -> bool:
    return int(getattr(message, "Status", FIX_3D)) >= FIX_3D


def _messages(path: Path) -> Iterator[Any]:
    os.environ.setdefault("MAVLINK20", "1")
    from pymavlink import mavutil

    try:
        log = mavutil.mavlink_connection(str(path), robust_parsing=True)
        while (message := log.recv_match()) is not None:
            yield message
        log.close()
    except Exception as error:  # pymavlink raises whatever its parsers stumble over
        raise FitError(f"{path.name} cannot be read as {path.suffix} ({error}); give an unbroken log") from None
