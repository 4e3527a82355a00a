"""Logs of any kind, by the endings of their names: runs to fit, and refusal of logs that show too little."""

from __future__ import annotations

import csv
import math
import os
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.bridge.blackbox import LogReader

from .runs import FitError, Run, Streams, Tell, untold

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


LONGEST_RUN_S = 30.0
"""Longer runs are cut into pieces, so that some can be held out."""
FEWEST_RUNS = 3
FEWEST_TURNING_DEG, FEWEST_SPEED_MPS = 20.0, 0.3
CHANGED_SHARE = 0.4
"""A stop, or a start, is seen where the boat's speed changes by so much of its top speed while it is told to."""

COLUMNS: dict[str, tuple[str, tuple[str, ...]]] = {
    "time": ("time", ("t_s", "time_s", "t", "time")),
    "x": ("x (east)", ("x_m", "east_m", "nav_x", "y_e")),
    "y": ("y (north)", ("y_m", "north_m", "nav_y", "x_n")),
    "heading": ("heading", ("heading_deg", "nav_heading", "yaw_deg_unwrapped", "yaw_deg")),
    "speed": ("speed", ("speed_mps", "nav_speed", "fwd_speed")),
    "told_speed": ("speed told", ("told_speed_mps", "cmd_speed_mps", "cmd_speed", "des_speed")),
    "told_heading": ("heading told", ("told_heading_deg", "cmd_heading_deg", "des_heading")),
}
"""Columns of a CSV of steps: in words, and the names that each may have."""
VARIABLES = {
    "NAV_X": "x",
    "NAV_Y": "y",
    "NAV_HEADING": "heading",
    "NAV_SPEED": "speed",
    "DESIRED_SPEED": "told_speed",
    "DESIRED_HEADING": "told_heading",
}
"""Of MOOS-IvP."""
HELM_HOLDS_S = 5.0
"""The helm of MOOS-IvP posts desired values when they change, and at least this often."""


def read_logs(
    paths: Sequence[Path],
    boat: str | None = None,
    system_id: int | None = None,
    tell: Tell = untold,
) -> list[Run]:
    """Read runs of all logs, long ones in pieces.

    Args:
        paths: of the logs.
        boat: name of the boat, of a black box with several.
        system_id: of the boat, of a telemetry log with several.
        tell: is told what of a log is left out, and why.

    Raises:
        FitError: a log cannot be read or contradicts itself, or together they show too little to fit.
    """
    readers: dict[str, Callable[[Path], list[Run]]] = {
        ".csv": lambda path: read_csv(path, tell),
        ".tlog": lambda path: read_tlog(path, system_id, tell),
        ".bin": lambda path: read_bin(path, tell),
        ".mcap": lambda path: read_box(path, boat, tell),
        ".alog": lambda path: read_alog(path, tell),
    }
    runs: list[Run] = []
    for path in paths:
        if path.suffix.lower() not in readers:
            raise FitError(f"{path.name} is no log that can be read; give {', '.join(readers)}")
        if not path.is_file():
            raise FitError(f"there is no log {path}")
        runs += readers[path.suffix.lower()](path)
    pieces = [piece for run in runs for piece in _pieces(run)]
    _check_enough(runs, len(pieces))
    return pieces


def read_csv(path: Path, tell: Tell = untold) -> list[Run]:
    """Read a CSV of steps, a row a time, columns known by their names.

    Raises:
        FitError: a column is missing, or a value is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = [(number, row) for number, row in enumerate(csv.reader(file), 1) if any(map(str.strip, row))]
    except csv.Error as error:
        raise FitError(f"{path.name} is no CSV ({error}); give a CSV of steps") from None
    if not rows:
        raise FitError(f"{path.name} is empty; give a CSV of steps")
    header, places = [name.strip() for name in rows[0][1]], {}
    if not {name for _, names in COLUMNS.values() for name in names} & set(header):
        raise FitError(f"{path.name} is no CSV of steps, its first line names none of their columns; give one")
    for what, (words, names) in COLUMNS.items():
        found = [header.index(name) for name in names if name in header]
        if not found:
            raise FitError(f"{path.name} has no column for {words}; name one {' or '.join(names)}")
        places[what] = found[0]
    if len(rows) == 1:
        raise FitError(f"{path.name} has no rows; give a CSV of steps")
    streams = Streams(path.stem, tell)
    for number, row in rows[1:]:
        try:
            values = {what: float(row[place]) for what, place in places.items()}
        except (ValueError, IndexError):
            raise FitError(f"{path.name} line {number}: a value is missing or no number; correct it") from None
        if math.isfinite(time_s := values.pop("time")):
            streams.clock(time_s)
            for what, value in values.items():
                streams.add(what, time_s, value)
    return streams.runs({what: words for what, (words, _) in COLUMNS.items()}, sampled=True)


def read_alog(path: Path, tell: Tell = untold) -> list[Run]:
    """Read MOOS-IvP's ``.alog``: a line a posting, ``time variable source value``.

    Raises:
        FitError: it tells too little.
    """
    streams = Streams(path.stem, tell)
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            parts = line.split()
            if len(parts) < 4 or parts[1] not in VARIABLES or line.startswith("%"):
                continue
            try:
                time_s, value = float(parts[0]), float(parts[3])
            except ValueError:
                continue  # a posting that is no number says nothing
            streams.clock(time_s)
            streams.add(VARIABLES[parts[1]], time_s, value)
    return streams.runs({what: name for name, what in VARIABLES.items()}, HELM_HOLDS_S)


def read_box(path: Path, boat: str | None, tell: Tell = untold) -> list[Run]:
    """Read one boat of a black box of ours; readings count from when they were true.

    Raises:
        FitError: it tells too little, or of several boats and none was named.
        LogError: it is no black-box log.
    """
    boats: dict[str, Streams] = {}
    with LogReader(path) as log:
        for tick in log.ticks():
            for name, reading in tick.readings.items():
                streams = boats.setdefault(name, Streams(path.stem, tell))
                if not math.isfinite(reading.age_s):
                    continue
                streams.clock(reading.read_s)
                at_s = reading.read_s - reading.position_age_s
                streams.add("x", at_s, reading.position_m[0])
                streams.add("y", at_s, reading.position_m[1])
                streams.add("heading", reading.read_s - reading.heading_age_s, math.degrees(reading.heading_rad))
                streams.add("speed", reading.read_s - reading.velocity_age_s, reading.speed_mps)
            for name, sent in tick.sent.items():
                if sent.delivered and math.isfinite(sent.heading_rad) and math.isfinite(sent.speed_mps):
                    streams = boats.setdefault(name, Streams(path.stem, tell))
                    streams.add("told_heading", sent.sent_s, math.degrees(sent.heading_rad))
                    streams.add("told_speed", sent.sent_s, sent.speed_mps)
    if boat is None and len(boats) > 1:
        raise FitError(f"{path.name} tells of boats {', '.join(sorted(boats))}; name one with --boat")
    name = boat or next(iter(boats), "")
    if name not in boats:
        raise FitError(f"{path.name} tells nothing of boat {name!r}; it has {', '.join(sorted(boats)) or 'none'}")
    told = ("told_speed", "told_heading")
    seen = ("x", "y", "heading", "speed")
    return boats[name].runs(dict.fromkeys(seen, "readings") | dict.fromkeys(told, "commands sent"))


def _pieces(run: Run) -> list[Run]:
    count = max(1, round(run.seconds / LONGEST_RUN_S))
    bounds = np.linspace(0, len(run.seen), count + 1).astype(int)
    return [run.part(a, b) for a, b in pairwise(bounds)]


def _check_enough(runs: Sequence[Run], pieces: int) -> None:
    """See that the boat turned, stopped and started.

    Raises:
        FitError: it did not; the text says what to drive.
    """
    remedy = "drive a sea-trial and give its log"
    if pieces < FEWEST_RUNS:
        raise FitError(f"the logs hold {pieces} runs, fewer than {FEWEST_RUNS}; {remedy}")
    top = max(float(run.seen[:, 3].max()) for run in runs)
    turned = max(float(np.ptp(run.seen[:, 2])) for run in runs)
    changed = max(float(np.ptp(run.seen[:, 3])) for run in runs)
    if top < FEWEST_SPEED_MPS or turned < FEWEST_TURNING_DEG or changed < FEWEST_SPEED_MPS:
        raise FitError(
            f"too little motion to fit: at most {top:.2f} m/s, {turned:.0f} deg turned, speed changed by "
            f"{changed:.2f} m/s; {remedy}"
        )
    for sign, words in ((-1.0, "told to stop and slow down"), (1.0, "told to go and gain speed")):
        seen = max(_changed(run, sign, top) for run in runs)
        if seen < CHANGED_SHARE * top:
            raise FitError(
                f"the boat was never seen {words}: by at most {seen:.1f} m/s of its {top:.1f}, so that its "
                f"{'way to stop' if sign < 0 else 'acceleration'} is not known; {remedy}"
            )


def _changed(run: Run, sign: float, top_mps: float) -> float:
    """Most that speed fell (sign -1) or rose (1) while told to go slower, or faster, than half of top speed, m/s."""
    asked = sign * (run.told[:, 0] - 0.5 * top_mps) >= 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], asked, [False]])))
    spans = [run.seen[a:b, 3] for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return max((float((sign * (span - span[0])).max()) for span in spans), default=0.0)
