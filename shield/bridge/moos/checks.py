"""Checks before a start of boats that run MOOS; they move no boat."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from functools import partial

from ..fleet_file import FleetFile
from ..fleet_settings import MoosLinkSettings
from ..link_checks import check_spread
from ..messages import BoatReading
from ..preflight_checks import Check, CheckResult
from .mission import mission_faults, read_mission
from .vehicle import MoosLink, client_name

WATCH_S, LOOK_EVERY_S = 5.0, 0.05
OLDEST_S = 0.5
LONGEST_TRIP_S = 0.2
APART_M = 5.0
"""NAV_X, NAV_Y and NAV_LAT, NAV_LONG agree within this."""


_Kind = Callable[[MoosLink, list[BoatReading], FleetFile], CheckResult]


class _Watch:
    """Readings of all links for a while, taken when first asked for; texts and faults stay with the readings."""

    def __init__(self, links: Mapping[str, MoosLink], seconds: float) -> None:
        self._links, self._seconds = links, seconds
        self._readings: dict[str, list[BoatReading]] = {}

    def readings(self, boat: str) -> list[BoatReading]:
        if not self._readings:
            self._readings = {name: [] for name in self._links}
            end_s = time.monotonic() + self._seconds
            while time.monotonic() < end_s:
                for name, link in self._links.items():
                    self._readings[name].append(link.read())
                time.sleep(LOOK_EVERY_S)
        return self._readings[boat]


def moos_checks(links: Mapping[str, MoosLink], fleet: FleetFile, seconds: float = WATCH_S) -> list[Check]:
    """All of them; the first to run watches all links for ``seconds``.

    Args:
        links: connected, by boat's name.
        fleet: the file.
        seconds: how long links are watched, real s.
    """
    watch = _Watch(links, seconds)
    kinds: dict[str, _Kind] = {
        "moosdb": check_moosdb,
        "rates": check_rates,
        "spread": lambda link, readings, fleet: check_spread(link.boat, readings),
        "grid": check_grid,
        "commanders": check_commanders,
        "mission": check_mission,
    }
    return [
        Check(f"{kind}:{boat}", partial(_run, check, link, watch, fleet))
        for boat, link in links.items()
        for kind, check in kinds.items()
    ]


def _run(check: _Kind, link: MoosLink, watch: _Watch, fleet: FleetFile) -> CheckResult:
    return check(link, watch.readings(link.boat), fleet)


def check_moosdb(link: MoosLink, readings: list[BoatReading], fleet: FleetFile) -> CheckResult:
    """The MOOSDB answers quickly, is the one of this boat, and took no damage."""
    name, health = f"moosdb:{link.boat}", link.health()
    figures = {"round_trip_s": health.round_trip_s, "sessions": float(health.sessions), "warp": link.client.warp}
    if not health.connected:
        return CheckResult(name, False, health.fault, figures)
    if health.sessions > 1 or health.damaged:
        text = f"the connection was made {health.sessions} times, {health.damaged} times for damaged packets"
        return CheckResult(name, False, f"{text}; find out why before you start", figures)
    if not health.round_trip_s <= LONGEST_TRIP_S:
        text = f"a heartbeat takes {health.round_trip_s:.2f} s there and back, more than {LONGEST_TRIP_S:g} s"
        return CheckResult(name, False, f"{text}; take a faster network, or run beside the MOOSDB", figures)
    text = f"community {health.community}, warp {link.client.warp:g}, round trip {1e3 * health.round_trip_s:.1f} ms"
    return CheckResult(name, True, text, figures)


def check_rates(link: MoosLink, readings: list[BoatReading], fleet: FleetFile) -> CheckResult:
    """NAV_* arrive, never late, and none is refused."""
    name = f"rates:{link.boat}"
    oldest = max((reading.age_s for reading in readings), default=math.inf)
    fixes = {reading.read_s - reading.position_age_s for reading in readings}
    refused: dict[str, int] = {}
    for reading in readings:
        for kind in ("type_clash", "not_finite", "clock", "impossible", "frozen", "bad_report"):
            refused[kind] = refused.get(kind, 0) + reading.faults.get(kind, 0)
    figures = {"oldest_s": oldest, "refused": float(sum(refused.values())), "fixes": float(len(fixes))}
    if figures["refused"]:
        said = next((text for reading in readings for text in reading.texts if "refused" in text), "")
        kinds = ", ".join(f"{count} {kind}" for kind, count in refused.items() if count)
        return CheckResult(name, False, f"refused while watched: {kinds}; {said or 'see the log'}", figures)
    if not oldest <= OLDEST_S:
        text = f"NAV_* were {oldest:.2f} s old, more than {OLDEST_S:g} s; raise the AppTick of what posts them to 10"
        return CheckResult(name, False, text, figures)
    return CheckResult(name, True, f"NAV_* never older than {oldest:.2f} s", figures)


def check_grid(link: MoosLink, readings: list[BoatReading], fleet: FleetFile) -> CheckResult:
    """NAV_X and NAV_Y, by the file's corner, are where NAV_LAT and NAV_LONG are, by its origin."""
    name, place = f"grid:{link.boat}", link.place_deg()
    position = readings[-1].position_m if readings else (math.nan, math.nan)
    if place is None:
        return CheckResult(name, True, "nobody posts NAV_LAT and NAV_LONG, so the corner is taken on trust")
    x, y = fleet.frame.to_field_m(*place)
    apart = math.hypot(x - position[0], y - position[1])
    if not apart <= APART_M:
        text = (
            f"NAV_X, NAV_Y have it at ({position[0]:.0f}, {position[1]:.0f}) m in the field and NAV_LAT, NAV_LONG at "
            f"({x:.0f}, {y:.0f}); correct the link's corner_m or the field's origin"
        )
        return CheckResult(name, False, text, {"apart_m": apart})
    return CheckResult(name, True, f"local grid and geodetic position agree within {apart:.1f} m", {"apart_m": apart})


def check_commanders(link: MoosLink, readings: list[BoatReading], fleet: FleetFile) -> CheckResult:
    """Nobody else writes what our gate writes, and its variables are numbers."""
    name, (other, seen_s) = f"commanders:{link.boat}", link.other_commander()
    if math.isfinite(seen_s):
        text = f"{other} also posts {' and '.join(link.gate.outputs)}; give it the prefix, or end it"
        return CheckResult(name, False, text)
    said = [text for reading in readings for text in reading.texts if "string" in text]
    if said:
        return CheckResult(name, False, said[0])
    wanting = {who for key in link.gate.inputs for who in link.writers.get(key, ())} - {client_name(link.boat)}
    text = f"nominal commands come from {', '.join(sorted(wanting))}" if wanting else "nobody commands it"
    return CheckResult(name, True, f"{text}; nobody else writes {' and '.join(link.gate.outputs)}")


def check_mission(link: MoosLink, readings: list[BoatReading], fleet: FleetFile) -> CheckResult:
    """The boat's .moos file stops a boat whose gate died, and lets nobody past it."""
    name, settings = f"mission:{link.boat}", fleet.boat(link.boat).link
    if not isinstance(settings, MoosLinkSettings) or settings.mission is None:
        text = "thresholds of its PID are in no MOOSDB; give the link mission: FILE.moos, or accept this check"
        return CheckResult(name, False, text)
    try:
        mission = read_mission(settings.mission)
    except (OSError, ValueError) as error:
        return CheckResult(name, False, f"cannot read {settings.mission} ({error}); correct the link's mission")
    port, platform = int(settings.address.rpartition(":")[2]), fleet.platform_of[link.boat]
    faults = mission_faults(mission, port, link.client.warp, platform, settings.gate, settings.prefix)
    return CheckResult(name, not faults, "; ".join(faults) or "prefix, ticks, thresholds and gains fit")
