"""Checks of the links alone: rates, latency, clock, position at rest, settings and fence of the autopilot, signing.

ArduPilot keeps a circle around home (FENCE_RADIUS) and zones to stay inside of or outside of. Where one of them acts,
it takes the boat away from the shield. It may do so only beyond the hard line (`geofence.beyond_m`) and the way that a
boat stopped there still runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..platforms import Platform, step_boat
from ..platforms import layout as L
from ..platforms.limits import cruise
from .autopilot_parameters import HOLD, STANDARD_TIMEOUT_S, parameter_faults, sails_by_itself
from .clock import Clock
from .fleet_file import FleetFile
from .mavlink.connection import GROUND_SYSTEM
from .mavlink.fence import FenceZone
from .mavlink.telemetry import ENOUGH_FIX
from .mavlink.vehicle import LinkHealth
from .messages import BoatReading, Link
from .preflight_checks import Check, Found, checks_by_kind, found

CIRCLE_TYPE, POLYGON_TYPE = 2, 4  # bits of FENCE_TYPE; the first bit is altitude
DEFAULTS = {"FENCE_TYPE": 6.0, "FENCE_RADIUS": 150.0, "FENCE_MARGIN": 2.0, "AVOID_ENABLE": 3.0, "AVOID_MARGIN": 2.0}
"""Of ArduPilot Rover, for what was not heard."""
STOPPED_SHARE, LONGEST_STOP_S = 0.02, 120.0
PART_M, MOST_PARTS = 0.05, 100_000
"""A fence's edges are looked at this finely, m, in no more parts; half a part is taken off."""
Box = tuple[float, float, float, float]
LONGEST_TRIP_S = 0.2
OLDEST_S = 0.5  # no field may get older than this while watched
WALL_S = 30.0  # signing refuses a clock a minute off; half of that is worth a word
REST_MPS = 0.3
SPREAD_M, RMS_M = 1.5, 0.5
_REFUSED = (
    "bad_checksum", "clock", "impossible_position", "impossible_speed", "impossible_attitude",
    "no_fix", "fix_silent", "poor_fix", "no_estimate",
)  # fmt: skip
WATCH_S = 5.0
LOOK_EVERY_S = 0.05


class Watch:
    """Readings and health of all links, connected, by boat's name; taken for so many seconds when first asked for."""

    def __init__(self, links: Mapping[str, Link], clock: Clock, seconds: float = WATCH_S) -> None:
        self._links, self._clock, self._seconds = links, clock, seconds
        self._readings: dict[str, list[BoatReading]] = {}
        self._health: dict[str, Any] = {}

    def readings(self, boat: str) -> list[BoatReading]:
        """What that boat said, in order."""
        self._look()
        return self._readings[boat]

    def health(self, boat: str) -> Any:
        """Health of its link at the end, of whatever kind."""
        self._look()
        return self._health[boat]

    def _look(self) -> None:
        if self._readings:
            return
        for link in self._links.values():
            link.learn(LOOK_EVERY_S * 60.0)
            link.read()  # what was refused before, while the boat came up, is not of this watch
        readings: dict[str, list[BoatReading]] = {name: [] for name in self._links}
        due = self._clock.now_s()
        for _ in range(round(self._seconds / LOOK_EVERY_S)):
            due += LOOK_EVERY_S
            self._clock.sleep_until(due)
            for name, link in self._links.items():
                readings[name].append(link.read())
        self._health = {name: link.health() for name, link in self._links.items()}
        self._readings = readings


@dataclass(frozen=True)
class Watched:
    """What checks look at: a boat of a file, what it said for a while, and its link at the end of that."""

    boat: str
    readings: list[BoatReading]
    health: LinkHealth
    fleet: FleetFile
    now_s: float


def link_checks(links: Mapping[str, Link], fleet: FleetFile, clock: Clock, seconds: float = WATCH_S) -> list[Check]:
    """All of them, of connected links by boat's name; they move no boat. The first watches all for ``seconds``."""
    watch = Watch(links, clock, seconds)

    def look(boat: str) -> Watched:
        return Watched(boat, watch.readings(boat), watch.health(boat), fleet, clock.now_s())

    return checks_by_kind(KINDS, links, look)


def check_rates(watched: Watched) -> Found:
    """Needed messages arrive at the rate asked for, never late, and none is refused."""
    readings, health = watched.readings, watched.health
    oldest = max((max(reading.age_s, reading.turn_rate_age_s) for reading in readings), default=math.inf)
    refused = {kind: sum(r.faults.get(kind, 0) for r in readings) for kind in _REFUSED}
    position, heading = (health.rates_hz.get(name, 0.0) for name in ("GLOBAL_POSITION_INT", "ATTITUDE"))
    figures = {
        "position_rate_hz": position,
        "attitude_rate_hz": heading,
        "oldest_s": oldest,
        "refused": float(sum(refused.values())),
    }
    unplaced = bool(readings) and readings[-1].position_age_s > OLDEST_S >= readings[-1].heading_age_s
    why = health.fix_fault or f"GPS fix type {health.fix_type}"
    kinds = ", ".join(f"{count} {kind}" for kind, count in refused.items() if count)
    return found(
        f"position {position:.0f} Hz, heading {heading:.0f} Hz, never older than {oldest:.2f} s",
        figures,
        (health.missing, f"{health.missing}; lower rate_hz or take a faster link"),
        (unplaced, f"the autopilot has no position yet ({why}); wait for GPS and its estimate, then run again"),
        (
            not oldest <= OLDEST_S,
            f"telemetry was {oldest:.2f} s old, more than {OLDEST_S:g} s; wait for GPS, or check the radio",
        ),
        (kinds, f"refused while watched: {kinds}; check GPS, radio and cables"),
    )


def check_latency(watched: Watched) -> Found:
    """Round trips are short: 95 of 100 within the limit."""
    health = watched.health
    if not health.round_trips_s:
        text = "it answers no TIMESYNC, so delays cannot be measured; update its firmware, or accept this check"
        return False, text, {}
    median, high = (float(q) for q in np.quantile(health.round_trips_s, [0.5, 0.95]))
    return found(
        f"round trip {median * 1e3:.0f} ms, 95 of 100 within {high * 1e3:.0f} ms",
        {"round_trip_median_s": median, "round_trip_p95_s": high, "telemetry_delay_s": health.shortest_delay_s},
        (
            not high <= LONGEST_TRIP_S,
            f"round trip {high:.2f} s (95 of 100), more than {LONGEST_TRIP_S:g} s; take a faster radio",
        ),
    )


def check_clock(watched: Watched) -> Found:
    """The boat's clock ran on since it was connected; with signing, wall clocks agree."""
    starts, ahead_s = watched.health.clock_starts, watched.health.wall_ahead_s
    return found(
        "the boat's clock runs on",
        {"starts": float(starts), "wall_ahead_s": ahead_s},
        (starts == 0, "no time-stamped telemetry heard; wait for a position, then run again"),
        (starts > 1, "the autopilot restarted while connected; check its power, run again"),
        (
            watched.health.signs and abs(ahead_s) > WALL_S,
            f"this machine's clock is {ahead_s:+.0f} s from the boat's GPS time, and signing needs it right; set this "
            "machine's clock",
        ),
    )


def check_spread(watched: Any) -> Found:
    """At rest the position hardly wanders; of a boat of any kind of link."""
    readings = watched.readings
    fixes = np.array([r.position_m for r in readings if math.isfinite(r.position_m[0]) and r.position_age_s < OLDEST_S])
    speeds = [abs(r.speed_mps) for r in readings if math.isfinite(r.speed_mps)]
    if len(fixes) < 10 or not speeds:
        return False, "no position to watch; wait for GPS, then run again", {}
    off = np.hypot(*(fixes - fixes.mean(axis=0)).T)
    rms, most, speed = float(np.sqrt(np.mean(off**2))), float(off.max()), float(np.median(speeds))
    return found(
        f"at rest {rms:.2f} m rms, {most:.2f} m at most",
        {"spread_rms_m": rms, "spread_max_m": most, "speed_mps": speed},
        (
            speed > REST_MPS,
            f"it moves at {speed:.1f} m/s, so its spread at rest cannot be seen; let it lie still, then run again",
        ),
        (
            rms > RMS_M or most > SPREAD_M,
            f"at rest its position wanders {rms:.2f} m rms, {most:.2f} m at most; wait for a better fix",
        ),
    )


def check_autopilot(watched: Watched) -> Found:
    """Firmware and parameters fit, nothing in it changes commands after the shield, and its position is a fix."""
    health, known = watched.health, watched.health.parameters
    top = known.get("WP_SPEED", math.nan)
    timeout = known.get("GUID_TIMEOUT", STANDARD_TIMEOUT_S)
    figures = {"wp_speed_mps": top, "timeout_s": timeout, "fix_type": float(health.fix_type)}
    faults = parameter_faults(known, watched.fleet.platform_of[watched.boat])
    if health.fix_fault:
        faults.append(f"{health.fix_fault}: wait for a good GPS fix")
    elif health.fix_type < 0:
        faults.append("it does not say whether GPS has a fix (no GPS_RAW_INT): let it send that message")
    elif health.fix_type < ENOUGH_FIX:
        faults.append(f"GPS has no fix (fix type {health.fix_type}): wait for one")
    version = "unknown" if health.version is None else ".".join(map(str, health.version))
    text = f"firmware {version}, WP_SPEED {top:g} m/s, own time-out {timeout:g} s"
    return found(text, figures, (faults, "; ".join(faults)))


def check_commanders(watched: Watched) -> Found:
    """Nobody else was seen to command the boat, and packets are signed where the file says so.

    Another ground station may listen, under another id than ours, whose commands the autopilot would obey.
    """
    health = watched.health
    who, alike = (
        ", ".join(f"system {system} component {component}" for system, component in sorted(stations))
        for stations in (health.stations, [place for place in health.stations if place[0] == GROUND_SYSTEM])
    )
    refused = [f"{health.faults[k]} {k}" for k in ("bad_signature", "second_sender") if health.faults.get(k)]
    ago_s = watched.now_s - health.other_commander_s
    others = f"nobody else; another ground station listens ({who})" if who else "nobody else"
    commander = f" ({health.commander.replace('(', '').replace(')', '')})" if health.commander else ""
    return found(
        f"{others}; {'packets signed' if health.signs else 'not signed'}",
        {"other_stations": float(len(health.stations)), "unsigned": float(health.faults.get("unsigned", 0))},
        (math.isfinite(ago_s), f"somebody else{commander} commanded it {ago_s:.0f} s ago; end that program"),
        (alike, f"another ground station has our id ({alike}): give it another id than {GROUND_SYSTEM}"),
        (
            refused,
            f"refused {', '.join(refused)}: somebody sends in this boat's name; find them before you start",
        ),
    )


def check_fence(watched: Watched) -> Found:
    """The autopilot's own fence is off, or so far out that no boat of ours gets there before it is stopped."""
    health, fleet, off = watched.health, watched.fleet, "set FENCE_ENABLE to 0"
    known, zones, home_deg = health.parameters, health.fence, health.home_deg
    if known.get("FENCE_ENABLE", 0.0) == 0.0:
        return True, "its own fence is off", {}
    value = {**DEFAULTS, **known}
    kinds = int(value["FENCE_TYPE"])
    if answer := sails_by_itself(known, "FENCE_ACTION"):
        return False, answer, {}
    if known.get("FENCE_ACTION") == 0.0:
        text = f"FENCE_ACTION is 0, so its own fence only reports and stops nothing: set it to {HOLD}, or {off}"
        return False, text, {}
    if fleet.geofence.then == "flee":
        text = f"geofence.then is flee, so its own fence (FENCE_ENABLE) may take the boat away: {off}, or then: stop"
        return False, text, {}
    if (kinds & POLYGON_TYPE and zones is None) or (kinds & CIRCLE_TYPE and home_deg is None):
        return False, f"FENCE_ENABLE is on and its fence cannot be read: {off}, or try again", {}
    every = list(zones or ()) if kinds & POLYGON_TYPE else []
    if kinds & CIRCLE_TYPE and home_deg is not None:
        every.append(FenceZone(True, (home_deg,), value["FENCE_RADIUS"]))
    line, needed = hard_line(fleet), needed_m(fleet, watched.boat, value)
    room = min((_room_m(zone, line, fleet) for zone in every), default=math.inf)
    where = f"{abs(room):.1f} m {'outside' if room >= 0.0 else 'inside'}"
    fine = f"its own fence lies at least {room:.1f} m outside the hard line, {needed:.1f} m needed to stop"
    fault = (
        f"its own fence lies {where} the hard line (geofence.beyond_m {fleet.geofence.beyond_m:g}), and the boat "
        f"needs {needed:.1f} m to stop: move the fence out by {needed - room:.1f} m, or {off}"
    )
    return found(
        fine if every else "its own fence is on and has no zones",
        {"fence_room_m": room, "fence_needed_m": needed} if every else {},
        (not room >= needed, fault),
    )


KINDS: Mapping[str, Callable[[Watched], Found]] = {
    "rates": check_rates,
    "latency": check_latency,
    "clock": check_clock,
    "spread": check_spread,
    "autopilot": check_autopilot,
    "commanders": check_commanders,
    "fence": check_fence,
}
"""The checks, by name."""


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
