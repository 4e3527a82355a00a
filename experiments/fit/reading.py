"""Logs of any kind, by the endings of their names: runs to fit, and refusal of logs that show too little."""

from __future__ import annotations

import csv
import math
import os
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.bridge.blackbox import LogReader

from ..words import count_text
from .runs import COMMANDED, NEEDED, SEEN, FitError, Notice, Run, Streams, silent, spans

EARTH_M = 6378137.0
POSITION, TOP_SPEED = "GLOBAL_POSITION_INT", ("WP_SPEED", "CRUISE_SPEED")
"""Parameters of which ArduPilot Rover takes the first that is not 0 for the speed that thrust is a share of."""
COMMANDS = ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED")
TLOG_NAMES = {
    **dict.fromkeys(SEEN, POSITION),
    "heading": f"ATTITUDE or {POSITION}",
    "commanded_speed": f"{COMMANDS[0]} with the parameter WP_SPEED, or {COMMANDS[1]}",
    "commanded_heading": " or ".join(COMMANDS),
}
BIN_NAMES = dict(zip(NEEDED, ("POS", "POS", "ATT.Yaw", "GPS.Spd", "THR.DesSpeed", "NTUN.DesYaw"), strict=True))
BIN_FIELDS = {name.partition(".")[0]: (what, name.partition(".")[2]) for what, name in BIN_NAMES.items() if "." in name}
MASK_IGNORES_RATES, MASK_VELOCITY_ONLY = 7, 3527
NO_HEADING, FIX_3D = 65535, 3
LONGEST_RUN_S = 30.0  # longer runs are cut into pieces, so that some can be held out
FEWEST_RUNS, FEWEST_TURNING_DEG, FEWEST_SPEED_MPS = 3, 20.0, 0.3
CHANGED_SHARE = 0.4
"""A stop, or a start, is seen where the boat's speed changes by so much of its top speed while it is commanded to."""
COLUMNS: dict[str, tuple[str, tuple[str, ...]]] = {
    "time": ("time", ("t_s", "time_s", "t", "time")),
    "x": ("x (east)", ("x_m", "east_m", "nav_x", "y_e")),
    "y": ("y (north)", ("y_m", "north_m", "nav_y", "x_n")),
    "heading": ("heading", ("heading_deg", "nav_heading", "yaw_deg_unwrapped", "yaw_deg")),
    "speed": ("speed", ("speed_mps", "nav_speed", "fwd_speed")),
    "commanded_speed": (
        "speed commanded",
        ("commanded_speed_mps", "told_speed_mps", "cmd_speed_mps", "cmd_speed", "des_speed"),
    ),
    "commanded_heading": (
        "heading commanded",
        ("commanded_heading_deg", "told_heading_deg", "cmd_heading_deg", "des_heading"),
    ),
}
"""Columns of a CSV of steps: in words, and the names that each may have."""
MOOS_NAMES = ("NAV_X", "NAV_Y", "NAV_HEADING", "NAV_SPEED", "DESIRED_SPEED", "DESIRED_HEADING")
VARIABLES = dict(zip(MOOS_NAMES, NEEDED, strict=True))  # of MOOS-IvP
HELM_HOLDS_S = 5.0  # the helm of MOOS-IvP posts desired values when they change, and at least this often


def read_logs(
    paths: Sequence[Path], boat: str | None = None, system_id: int | None = None, notice: Notice = silent
) -> list[Run]:
    """Read runs of all logs, long ones in pieces.

    Args:
        paths: of the logs.
        boat: name of the boat, of a black box with several.
        system_id: of the boat, of a telemetry log with several.
        notice: gets a sentence about what of a log is left out, and why.

    Raises:
        FitError: a log cannot be read or contradicts itself, or together they show too little to fit.
        LogError: it is no black-box log.
    """
    readers: dict[str, Callable[[Path, Notice], list[Run]]] = {
        ".csv": read_csv,
        ".tlog": partial(read_tlog, system_id=system_id),
        ".bin": read_bin,
        ".mcap": partial(read_box, boat=boat),
        ".alog": read_alog,
    }
    runs: list[Run] = []
    for path in paths:
        if path.suffix.lower() not in readers:
            raise FitError(f"{path.name} is no log that can be read; give {', '.join(readers)}")
        if not path.is_file():
            raise FitError(
                f"there is no log {path}; give the path of one that sea-trial or deploy wrote, or a log of a boat"
            )
        runs += readers[path.suffix.lower()](path, notice)
    pieces = [run.part(a, b) for run in runs for a, b in run.bounds(LONGEST_RUN_S)]
    _check_enough(runs, len(pieces))
    return pieces


def read_csv(path: Path, notice: Notice) -> list[Run]:
    """Read a CSV of steps, a row a time, columns known by their names."""
    try:
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = [(number, row) for number, row in enumerate(csv.reader(file), 1) if any(map(str.strip, row))]
    except csv.Error as error:
        raise FitError(f"{path.name} is no CSV ({error}); give a CSV of steps") from None
    if not rows:
        raise FitError(f"{path.name} is empty; give a CSV of steps")
    header = [name.strip() for name in rows[0][1]]
    places = {what: [header.index(name) for name in names if name in header] for what, (_, names) in COLUMNS.items()}
    if not any(places.values()):
        raise FitError(f"{path.name} is no CSV of steps, its first line names none of their columns; give one")
    for what, (words, names) in COLUMNS.items():
        if not places[what]:
            raise FitError(f"{path.name} has no column for {words}; name one {' or '.join(names)}")
    if len(rows) == 1:
        raise FitError(f"{path.name} has no rows; give a CSV of steps")
    streams = Streams(path.stem, notice)
    for number, row in rows[1:]:
        try:
            values = {what: float(row[found[0]]) for what, found in places.items()}
        except (ValueError, IndexError):
            raise FitError(f"{path.name} line {number}: a value is missing or no number; correct it") from None
        if math.isfinite(time_s := values.pop("time")):
            streams.clock(time_s)
            streams.add_all(time_s, **values)
    return streams.runs({what: words for what, (words, _) in COLUMNS.items()}, sampled=True)


def read_alog(path: Path, notice: Notice) -> list[Run]:
    """Read MOOS-IvP's ``.alog``: a line a posting, ``time variable source value``."""
    streams = Streams(path.stem, notice)
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


def read_box(path: Path, notice: Notice, boat: str | None = None) -> list[Run]:
    """Read one boat of a black box of ours; readings count from when they were true."""
    boats: dict[str, Streams] = {}
    with LogReader(path) as log:
        for tick in log.ticks():
            for name, reading in tick.readings.items():
                streams = boats.setdefault(name, Streams(path.stem, notice))
                if math.isfinite(reading.age_s):
                    streams.clock(reading.read_s)
                    x_m, y_m = reading.position_m
                    streams.add_all(reading.read_s - reading.position_age_s, x=x_m, y=y_m)
                    streams.add("heading", reading.read_s - reading.heading_age_s, math.degrees(reading.heading_rad))
                    streams.add("speed", reading.read_s - reading.velocity_age_s, reading.speed_mps)
            for name, sent in tick.sent.items():
                if sent.delivered and math.isfinite(sent.heading_rad) and math.isfinite(sent.speed_mps):
                    streams, heading_deg = (
                        boats.setdefault(name, Streams(path.stem, notice)),
                        math.degrees(sent.heading_rad),
                    )
                    streams.add_all(sent.sent_s, commanded_heading=heading_deg, commanded_speed=sent.speed_mps)
    name = _chosen(path, sorted(boats), boat, "--boat")
    return boats[name].runs(dict.fromkeys(SEEN, "readings") | dict.fromkeys(COMMANDED, "commands sent"))


def _chosen(path: Path, known: Sequence[Any], asked: Any, option: str) -> Any:
    """Which of the boats in a log is meant."""
    names = ", ".join(map(str, known)) or "none"
    if asked is None and len(known) > 1:
        raise FitError(f"{path.name} tells of boats {names}; name one with {option}")
    if not known or asked not in (None, *known):
        raise FitError(f"{path.name} tells nothing of boat {asked or ''}; it has {names}")
    return known[0] if asked is None else asked


def read_tlog(path: Path, notice: Notice, system_id: int | None = None) -> list[Run]:
    """Read one boat of a telemetry log."""
    kept = [m for m in _messages(path) if m.get_type() in (*COMMANDS, POSITION, "ATTITUDE", "PARAM_VALUE")]
    sources = Counter(_source(m) for m in kept if m.get_type() == POSITION and _is_place(m.lat, m.lon))
    if not sources:
        raise FitError(f"{path.name} tells no positions ({POSITION}); give a log of a boat's telemetry")
    number = _chosen(path, sorted({system for system, _ in sources}), system_id, "--system-id")
    source = max((one for one in sources if one[0] == number), key=lambda one: (sources[one], -one[1]))
    said = [m for m in kept if m.get_type() not in COMMANDS and _source(m) == source]
    origin = _middle([(m.lat, m.lon) for m in said if m.get_type() == POSITION])
    tops = [[(_time_s(m), m.param_value) for m in said if _parameter(m) == name] for name in TOP_SPEED]
    has_attitude = any(m.get_type() == "ATTITUDE" for m in said)
    streams, heading_deg = Streams(path.stem, notice), math.nan
    for m in kept:
        kind, time_s = m.get_type(), _time_s(m)
        streams.clock(time_s)
        if kind in COMMANDS:
            if m.target_system in (0, number):
                streams.add_all(time_s, **_command(m, tops, time_s))
        elif _source(m) != source:
            continue
        elif kind == "ATTITUDE":
            heading_deg = math.degrees(m.yaw)
            streams.add("heading", time_s, heading_deg)
        elif kind == POSITION and _is_place(m.lat, m.lon):
            course_deg = heading_deg if m.hdg == NO_HEADING else m.hdg / 100.0
            if m.hdg != NO_HEADING and not has_attitude:
                heading_deg = course_deg
                streams.add("heading", time_s, heading_deg)
            x, y = place_m(origin, m.lat / 1e7, m.lon / 1e7)
            way = math.radians(course_deg)
            streams.add_all(time_s, x=x, y=y, speed=(m.vx * math.cos(way) + m.vy * math.sin(way)) / 100.0)
    return streams.runs(TLOG_NAMES)


def _command(m: Any, tops: Sequence[Sequence[tuple[float, float]]], time_s: float) -> dict[str, float]:
    """Speed and heading that a command asks for; empty: it asks for something else."""
    if m.get_type() == COMMANDS[1]:
        if m.type_mask != MASK_VELOCITY_ONLY:
            return {}
        return {"commanded_heading": math.degrees(math.atan2(m.vy, m.vx)), "commanded_speed": math.hypot(m.vx, m.vy)}
    if m.type_mask != MASK_IGNORES_RATES or not math.isfinite(top_mps := _top_mps(tops, time_s)):
        return {}
    w, x, y, z = m.q
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return {"commanded_heading": math.degrees(yaw), "commanded_speed": m.thrust * top_mps}


def _top_mps(tops: Sequence[Sequence[tuple[float, float]]], time_s: float) -> float:
    """Speed of full thrust at a time; before it was first set only if it is the same all along, else NaN."""
    for settings in tops:
        at = bisect_right([when_s for when_s, _ in settings], time_s)
        known = settings[at - 1 : at] or (settings[:1] if len({value for _, value in settings}) == 1 else [])
        if not known and settings:
            return math.nan
        if known and known[0][1] > 0.0:
            return known[0][1]
    return math.nan


def _parameter(message: Any) -> str:
    return str(message.param_id).rstrip("\0") if message.get_type() == "PARAM_VALUE" else ""


def _time_s(message: Any) -> float:
    return float(message._timestamp)


def _source(message: Any) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()


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


def read_bin(path: Path, notice: Notice) -> list[Run]:
    """Read an ArduPilot log; of several GPS receivers the one that most often has a fix."""
    kept = [message for message in _messages(path) if message.get_type() in ("POS", *BIN_FIELDS)]
    origin = _middle([_raw_place(m) for m in kept if m.get_type() == "POS"])
    receivers = Counter(getattr(m, "I", 0) for m in kept if m.get_type() == "GPS" and _has_fix(m))
    receiver = max(receivers, key=lambda number: (receivers[number], -number), default=0)
    streams = Streams(path.stem, notice)
    for m in kept:
        kind = m.get_type()
        what, name = BIN_FIELDS.get(kind, ("", ""))
        for needed in ("TimeUS", *([name] if name else ())):
            if not hasattr(m, needed):
                raise FitError(f"{path.name}: its {kind} messages have no {needed}; give a log of ArduPilot Rover 4")
        time_s = float(m.TimeUS) / 1e6
        streams.clock(time_s)
        if kind == "POS" and _is_place(*_raw_place(m)):
            x, y = place_m(origin, m.Lat, m.Lng)
            streams.add_all(time_s, x=x, y=y)
        elif what and (kind != "GPS" or (_has_fix(m) and getattr(m, "I", 0) == receiver)):
            streams.add(what, time_s, float(getattr(m, name)))
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


def _check_enough(runs: Sequence[Run], pieces: int) -> None:
    """See that the boat turned, stopped and started, else `FitError`, whose text says what to drive."""
    remedy = "drive a sea-trial and give its log"
    if pieces < FEWEST_RUNS:
        raise FitError(f"the logs hold {count_text(pieces, 'run')}, fewer than {FEWEST_RUNS}; {remedy}")
    top = max(float(run.seen[:, 3].max()) for run in runs)
    turned, changed = (max(float(np.ptp(run.seen[:, column])) for run in runs) for column in (2, 3))
    if top < FEWEST_SPEED_MPS or turned < FEWEST_TURNING_DEG or changed < FEWEST_SPEED_MPS:
        raise FitError(
            f"too little motion to fit: at most {top:.2f} m/s, {turned:.0f} deg turned, speed changed by "
            f"{changed:.2f} m/s; {remedy}"
        )
    for sign, words, unknown in (
        (-1.0, "commanded to stop and slow down", "way to stop"),
        (1.0, "commanded to go and gain speed", "acceleration"),
    ):
        seen = max(_changed(run, sign, top) for run in runs)
        if seen < CHANGED_SHARE * top:
            raise FitError(
                f"the boat was never seen {words}: by at most {seen:.1f} m/s of its {top:.1f}, so that its "
                f"{unknown} is not known; {remedy}"
            )


def _changed(run: Run, sign: float, top_mps: float) -> float:
    """Most that speed fell (sign -1) or rose (1) while commanded slower, or faster, than half of top speed, m/s."""
    asked = spans(sign * (run.commanded[:, 0] - 0.5 * top_mps) >= 0.0)
    return max((float((sign * (run.seen[a:b, 3] - run.seen[a, 3])).max()) for a, b in asked), default=0.0)
