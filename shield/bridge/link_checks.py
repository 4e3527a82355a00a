"""Checks of the links alone: rates, latency, clock, position at rest, the autopilot's settings, signing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..platforms import Platform
from .autopilot_parameters import STANDARD_TIMEOUT_S, parameter_faults
from .clock import Clock
from .mavlink.telemetry import ENOUGH_FIX
from .mavlink.vehicle import LinkHealth
from .messages import BoatReading, Link
from .preflight_checks import Check, Found, checks_by_kind

LONGEST_TRIP_S = 0.2
OLDEST_S = 0.5
"""No field may get older than this while watched."""
WALL_S = 30.0
"""Signing refuses a clock a minute off; half of that is worth a word."""
REST_MPS = 0.3
SPREAD_M = 1.5
RMS_M = 0.5
_REFUSED = (
    "bad_checksum", "clock", "impossible_position", "impossible_speed", "impossible_attitude",
    "no_fix", "fix_silent", "poor_fix", "no_estimate",
)  # fmt: skip


WATCH_S = 5.0
LOOK_EVERY_S = 0.05


class Watch:
    """Readings and health of all links; taken when first asked for.

    Args:
        links: connected, by boat's name.
        clock: the loop's.
        seconds: how long.
    """

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
    """What checks look at: a boat of that platform, what it said for a while, and its link at the end of that."""

    boat: str
    readings: list[BoatReading]
    health: LinkHealth
    platform: Platform
    now_s: float


def link_checks(
    links: Mapping[str, Link], platforms: Mapping[str, Platform], clock: Clock, seconds: float = WATCH_S
) -> list[Check]:
    """All of them; they move no boat. The first to run watches all links for ``seconds``.

    Args:
        links: connected, by boat's name.
        platforms: of each boat, by name.
        clock: the loop's.
        seconds: how long links are watched.
    """
    watch = Watch(links, clock, seconds)

    def look(boat: str) -> Watched:
        return Watched(boat, watch.readings(boat), watch.health(boat), platforms[boat], clock.now_s())

    return checks_by_kind(KINDS, links, look)


def check_rates(watched: Watched) -> Found:
    """Needed messages arrive at the rate asked for, never late, and none is refused."""
    readings, health = watched.readings, watched.health
    ages = [max(reading.age_s, reading.turn_rate_age_s) for reading in readings]
    refused = {kind: sum(r.faults.get(kind, 0) for r in readings) for kind in _REFUSED}
    figures = {
        "position_rate_hz": health.rates_hz.get("GLOBAL_POSITION_INT", 0.0),
        "attitude_rate_hz": health.rates_hz.get("ATTITUDE", 0.0),
        "oldest_s": max(ages, default=math.inf),
        "refused": float(sum(refused.values())),
    }
    if health.missing:
        return False, f"{health.missing}; lower rate_hz or take a faster link", figures
    if readings and readings[-1].position_age_s > OLDEST_S >= readings[-1].heading_age_s:
        why = health.fix_fault or f"GPS fix type {health.fix_type}"
        text = f"the autopilot has no position yet ({why}); wait for GPS and its estimate, then run again"
        return False, text, figures
    if not figures["oldest_s"] <= OLDEST_S:
        text = (
            f"telemetry was {figures['oldest_s']:.2f} s old, more than {OLDEST_S:g} s; wait for GPS, or check the radio"
        )
        return False, text, figures
    if figures["refused"]:
        kinds = ", ".join(f"{count} {kind}" for kind, count in refused.items() if count)
        return False, f"refused while watched: {kinds}; check GPS, radio and cables", figures
    text = f"position {figures['position_rate_hz']:.0f} Hz, heading {figures['attitude_rate_hz']:.0f} Hz"
    return True, f"{text}, never older than {figures['oldest_s']:.2f} s", figures


def check_latency(watched: Watched) -> Found:
    """Round trips are short: 95 of 100 within the limit."""
    health = watched.health
    if not health.round_trips_s:
        text = "it answers no TIMESYNC, so delays cannot be measured; update its firmware, or accept this check"
        return False, text, {}
    median, high = (float(q) for q in np.quantile(health.round_trips_s, [0.5, 0.95]))
    figures = {"round_trip_median_s": median, "round_trip_p95_s": high, "telemetry_delay_s": health.shortest_delay_s}
    if not high <= LONGEST_TRIP_S:
        text = f"round trip {high:.2f} s (95 of 100), more than {LONGEST_TRIP_S:g} s; take a faster radio"
        return False, text, figures
    return True, f"round trip {median * 1e3:.0f} ms, 95 of 100 within {high * 1e3:.0f} ms", figures


def check_clock(watched: Watched) -> Found:
    """The boat's clock ran on since it was connected; with signing, wall clocks agree."""
    health = watched.health
    figures = {"starts": float(health.clock_starts), "wall_ahead_s": health.wall_ahead_s}
    if health.clock_starts == 0:
        return False, "no time-stamped telemetry heard; wait for a position, then run again", figures
    if health.clock_starts > 1:
        return False, "the autopilot restarted while connected; check its power, run again", figures
    if health.signs and abs(health.wall_ahead_s) > WALL_S:
        text = (
            f"this machine's clock is {health.wall_ahead_s:+.0f} s from the boat's GPS time, and signing needs it right"
        )
        return False, f"{text}; set this machine's clock", figures
    return True, "the boat's clock runs on", figures


def check_spread(watched: Any) -> Found:
    """At rest the position hardly wanders; of a boat of any kind of link."""
    readings = watched.readings
    fixes = np.array([r.position_m for r in readings if math.isfinite(r.position_m[0]) and r.position_age_s < OLDEST_S])
    speeds = [abs(r.speed_mps) for r in readings if math.isfinite(r.speed_mps)]
    if len(fixes) < 10 or not speeds:
        return False, "no position to watch; wait for GPS, then run again", {}
    off = np.hypot(*(fixes - fixes.mean(axis=0)).T)
    rms, most, speed = float(np.sqrt(np.mean(off**2))), float(off.max()), float(np.median(speeds))
    figures = {"spread_rms_m": rms, "spread_max_m": most, "speed_mps": speed}
    if speed > REST_MPS:
        text = f"it moves at {speed:.1f} m/s, so its spread at rest cannot be seen; let it lie still, then run again"
        return False, text, figures
    if rms > RMS_M or most > SPREAD_M:
        text = f"at rest its position wanders {rms:.2f} m rms, {most:.2f} m at most; wait for a better fix"
        return False, text, figures
    return True, f"at rest {rms:.2f} m rms, {most:.2f} m at most", figures


def check_autopilot(watched: Watched) -> Found:
    """Firmware and parameters fit, nothing in it changes commands after the shield, and its position is a fix."""
    health = watched.health
    known = health.parameters
    top = known.get("WP_SPEED", math.nan)
    timeout = known.get("GUID_TIMEOUT", STANDARD_TIMEOUT_S)
    figures = {"wp_speed_mps": top, "timeout_s": timeout, "fix_type": float(health.fix_type)}
    faults = [*parameter_faults(known, watched.platform), *_fix_faults(health)]
    version = "unknown" if health.version is None else ".".join(map(str, health.version))
    text = "; ".join(faults) or f"firmware {version}, WP_SPEED {top:g} m/s, own time-out {timeout:g} s"
    return not faults, text, figures


def _fix_faults(health: LinkHealth) -> list[str]:
    if health.fix_fault:
        return [f"{health.fix_fault}: wait for a good GPS fix"]
    if health.fix_type < 0:
        return ["it does not say whether GPS has a fix (no GPS_RAW_INT): let it send that message"]
    return [] if health.fix_type >= ENOUGH_FIX else [f"GPS has no fix (fix type {health.fix_type}): wait for one"]


def check_commanders(watched: Watched) -> Found:
    """Nobody else was seen to command the boat or to be ready to, and packets are signed where the file says so."""
    health = watched.health
    figures = {"other_stations": float(len(health.stations)), "unsigned": float(health.faults.get("unsigned", 0))}
    who = ", ".join(f"system {system} component {component}" for system, component in sorted(health.stations))
    if math.isfinite(health.other_commander_s):
        text = f"somebody else commanded it {watched.now_s - health.other_commander_s:.0f} s ago; end that program"
        return False, text, figures
    if health.stations:
        text = f"another ground station is on the link ({who}); end it, or accept this check if it only listens"
        return False, text, figures
    refused = [f"{health.faults[k]} {k}" for k in ("bad_signature", "second_sender") if health.faults.get(k)]
    if refused:
        text = f"refused {', '.join(refused)}: somebody sends in this boat's name; find them before you start"
        return False, text, figures
    return True, "nobody else; packets signed" if health.signs else "nobody else; not signed", figures


KINDS: Mapping[str, Callable[[Watched], Found]] = {
    "rates": check_rates,
    "latency": check_latency,
    "clock": check_clock,
    "spread": check_spread,
    "autopilot": check_autopilot,
    "commanders": check_commanders,
}
"""The checks, by name."""
