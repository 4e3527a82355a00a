"""Checks before a start of boats that run MOOS; they move no boat.

What a MOOSDB does not say is read from the boat's .moos file: thresholds, ticks, prefix, gains.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from ...platforms import Platform
from ..clock import MonotonicClock
from ..fleet_file import FleetFile
from ..fleet_settings import MoosLinkSettings
from ..link_checks import LONGEST_TRIP_S, OLDEST_S, WATCH_S, Watch, check_spread
from ..messages import BoatReading
from ..preflight_checks import Check, Found, checks_by_kind
from .client import Health
from .state import REFUSED, VARIABLES
from .vehicle import MoosLink, client_name

APART_M = 5.0  # NAV_X, NAV_Y and NAV_LAT, NAV_LONG agree within this
SHORTEST_S, LONGEST_S = 1.0, 2.0
"""Bounds of a PID's tardy thresholds: it must outlast two missed commands, and stop a boat whose gate died."""
PIDS = ("pMarinePID", "pMarinePIDV22")
SIMULATORS = {"uSimMarine": 0.0, "uSimMarineV22": 5.0, "uSimMarineV23": 5.0}
"""The speed from which each turns a boat by its turn_rate, in proportion below, m/s; 0: at any speed."""
TURN_RATE, MOST_TURN_RATE = 70.0, 100.0  # of a simulator whose mission gives none, and the most that it takes
LEAST_TICK = {**dict.fromkeys((*PIDS, *SIMULATORS), 5.0), "pHelmIvP": 2.0, "pNodeReporter": 2.0}
GAIN_OFF = 0.2  # share by which a PID's gains may differ from the platform's
_BLOCK = re.compile(r"ProcessConfig\s*=\s*(\w+)\s*\{([^}]*)\}", re.IGNORECASE)
_ENTRY = re.compile(r"^\s*([\w.]+)\s*=\s*(.*?)\s*(?://.*)?$")

Mission = dict[str, dict[str, str]]


@dataclass(frozen=True)
class Watched:
    """What a check looks at: a boat's link, what it said for a while, the file, and the mission where there is one."""

    link: MoosLink
    readings: list[BoatReading]
    health: Health
    fleet: FleetFile
    settings: MoosLinkSettings

    def mission(self) -> Mission:
        """Settings of the boat's .moos file; empty: the fleet file names none.

        Raises:
            OSError: it cannot be read.
            ValueError: it holds no text.
        """
        path = self.settings.mission
        return {} if path is None else parse_mission(path.read_text(encoding="utf-8"))


def moos_checks(links: Mapping[str, MoosLink], fleet: FleetFile, seconds: float = WATCH_S) -> list[Check]:
    """All of them; the first to run watches all links, connected, for so many real s."""
    watch = Watch(links, MonotonicClock(), seconds)

    def look(boat: str) -> Watched:
        settings = fleet.boat(boat).link
        if not isinstance(settings, MoosLinkSettings):
            raise TypeError(f"boat {boat} has no link of MOOS")
        return Watched(links[boat], watch.readings(boat), watch.health(boat), fleet, settings)

    return checks_by_kind(KINDS, links, look)


def check_moosdb(watched: Watched) -> Found:
    """The MOOSDB answers quickly, is the one of this boat, and took no damage."""
    health, warp = watched.health, watched.link.client.warp
    figures = {"round_trip_s": health.round_trip_s, "sessions": float(health.sessions), "warp": warp}
    if health.fault:
        return False, health.fault, figures
    if health.sessions > 1 or health.damaged:
        text = f"the connection was made {health.sessions} times, {health.damaged} times for damaged packets"
        return False, f"{text}; find out why before you start", figures
    if not health.round_trip_s <= LONGEST_TRIP_S:
        text = f"a heartbeat takes {health.round_trip_s:.2f} s there and back, more than {LONGEST_TRIP_S:g} s"
        return False, f"{text}; take a faster network, or run beside the MOOSDB", figures
    return True, f"community {health.community}, warp {warp:g}, round trip {1e3 * health.round_trip_s:.1f} ms", figures


def check_rates(watched: Watched) -> Found:
    """NAV_* arrive, each from one source, never late, and none is refused."""
    readings, writers = watched.readings, watched.link.writers
    oldest = max((reading.age_s for reading in readings), default=math.inf)
    fixes = {reading.read_s - reading.position_age_s for reading in readings}
    refused = {kind: sum(r.faults.get(kind, 0) for r in readings) for kind in (*REFUSED, "bad_report")}
    figures = {"oldest_s": oldest, "refused": float(sum(refused.values())), "fixes": float(len(fixes))}
    if figures["refused"]:
        said = next((text for reading in readings for text in reading.texts if "refused" in text), "see the log")
        kinds = ", ".join(f"{count} {kind}" for kind, count in refused.items() if count)
        return False, f"refused while watched: {kinds}; {said}", figures
    if shared := [key for key in VARIABLES if len(writers.get(key, ())) > 1]:
        text = f"{shared[0]} is written by {' and by '.join(sorted(writers[shared[0]]))}: two say where it is, end one"
        return False, text, figures
    if not oldest <= OLDEST_S:
        text = f"NAV_* were {oldest:.2f} s old, more than {OLDEST_S:g} s; raise the AppTick of what posts them to 10"
        return False, text, figures
    return True, f"NAV_* never older than {oldest:.2f} s", figures


def check_grid(watched: Watched) -> Found:
    """NAV_X and NAV_Y, by the file's corner, are where NAV_LAT and NAV_LONG are, by its origin."""
    place, position = watched.link.place_deg(), watched.readings[-1].position_m
    if place is None:
        return True, "nobody posts NAV_LAT and NAV_LONG, so the corner is taken on trust", {}
    x, y = watched.fleet.frame.to_field_m(*place)
    apart = math.hypot(x - position[0], y - position[1])
    if not apart <= APART_M:
        text = (
            f"NAV_X, NAV_Y have it at ({position[0]:.0f}, {position[1]:.0f}) m in the field and NAV_LAT, NAV_LONG at "
            f"({x:.0f}, {y:.0f}); correct the link's corner_m or the field's origin"
        )
        return False, text, {"apart_m": apart}
    return True, f"local grid and geodetic position agree within {apart:.1f} m", {"apart_m": apart}


def check_commanders(watched: Watched) -> Found:
    """Nobody else writes what our gate writes, and its variables are numbers."""
    link = watched.link
    (other, seen_s), outputs = link.other_commander(), " and ".join(link.gate.outputs)
    if math.isfinite(seen_s):
        return False, f"{other} also posts {outputs}; give it the prefix, or end it", {}
    if said := [text for reading in watched.readings for text in reading.texts if "string" in text]:
        return False, said[0], {}
    wanting = {who for key in link.gate.inputs for who in link.writers.get(key, ())} - {client_name(link.boat)}
    text = f"nominal commands come from {', '.join(sorted(wanting))}" if wanting else "nobody commands it"
    return True, f"{text}; nobody else writes {outputs}", {}


def check_mission(watched: Watched) -> Found:
    """The boat's .moos file stops a boat whose gate died, and lets nobody past it."""
    settings, link = watched.settings, watched.link
    if settings.mission is None:
        text = "thresholds of its PID are in no MOOSDB; give the link mission: FILE.moos, or accept this check"
        return False, text, {}
    try:
        mission = watched.mission()
    except (OSError, ValueError) as error:
        return False, f"cannot read {settings.mission} ({error}); correct the link's mission", {}
    port, platform = int(settings.address.rpartition(":")[2]), watched.fleet.platform_of[link.boat]
    faults = list(mission_faults(mission, port, link.client.warp, platform, settings.gate, settings.prefix))
    return not faults, "; ".join(faults) or "prefix, ticks, thresholds and gains fit", {}


def check_stop(watched: Watched) -> Found:
    """What is behind the gate when it dies, and after how long that stops the boat."""
    settings, mission = watched.settings, watched.mission()
    if settings.gate == "helm":
        pids = [name for name in PIDS if name in mission]
        seconds = number(mission, pids[0], "tardy_helm_threshold", LONGEST_S) if pids else LONGEST_S
        source = f"{pids[0]} takes" if pids else "its PID, if set as the docs say, takes"
        text = f"when the gate dies, {source} thrust off {seconds:g} s after the last command"
        return True, text, {"stop_s": seconds}
    keeps = [name for name in SIMULATORS if name in mission]
    if settings.thrust_timeout_s is not None and keeps:
        text = f"thrust_timeout_s is {settings.thrust_timeout_s:g}, but {keeps[0]} of its mission keeps its last thrust"
        return False, f"{text} for ever; give nothing_stops_it: true instead, or take gate: helm", {}
    if settings.thrust_timeout_s is not None:
        text = f"when the gate dies, its actuators take thrust off after {settings.thrust_timeout_s:g} s, by the file"
        return True, f"{text}: see that with your own eyes before a run", {"stop_s": settings.thrust_timeout_s}
    text = "NOTHING stops it when the gate dies: its last thrust stays on, as the fleet file acknowledges"
    return True, f"{text}; keep something at hand that cuts its power", {"stop_s": math.inf}


KINDS: Mapping[str, Callable[[Watched], Found]] = {
    "moosdb": check_moosdb,
    "rates": check_rates,
    "spread": check_spread,
    "grid": check_grid,
    "commanders": check_commanders,
    "mission": check_mission,
    "stop": check_stop,
}
"""The checks, by name."""


def parse_mission(text: str) -> Mission:
    """Settings of each app of a .moos file, keys in lower case; those of the file itself under ''."""

    def entries(body: str) -> dict[str, str]:
        found = (_ENTRY.match(line) for line in body.splitlines())
        return {match[1].lower(): match[2] for match in found if match is not None}

    text = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("//"))
    return {"": entries(_BLOCK.sub("", text)), **{name: entries(body) for name, body in _BLOCK.findall(text)}}


def number(mission: Mission, app: str, key: str, otherwise: float) -> float:
    """A number of a mission; NaN where it is none, which fits nowhere."""
    try:
        return float(mission.get(app, {}).get(key, otherwise))
    except ValueError:
        return math.nan


def mission_faults(
    mission: Mission, port: int, warp: float, platform: Platform, gate: str, prefix: str
) -> Iterator[str]:
    """Everything in a boat's mission that would undo the shield, each with its remedy; ``port``: of its MOOSDB."""
    top, helm, pids = mission.get("", {}), mission.get("pHelmIvP"), [name for name in PIDS if name in mission]
    if number(mission, "", "serverport", port) != port:
        yield f"ServerPort is {top['serverport']} and the link's port {port}: give both the same"
    if not math.isclose(number(mission, "", "moostimewarp", 1.0), warp):
        yield f"MOOSTimeWarp is {top.get('moostimewarp', '1')} and this run's --speed {warp:g}: give both the same"
    if helm is not None and gate == "helm" and helm.get("helm_prefix", "") != prefix:
        yield f"pHelmIvP writes DESIRED_* itself: set helm_prefix = {prefix}"
    if helm is not None and helm.get("allow_override", "true").lower() == "false":
        yield "pHelmIvP has allow_override = false, so nobody can take the boat by hand: set it to true"
    if len(pids) != 1:
        yield f"{len(pids)} PIDs are configured: have one of {' and '.join(PIDS)}"
    for name in pids:
        yield from _pid_faults(mission, name, platform)
    for name in SIMULATORS:
        if name in mission:
            yield from _hull_faults(mission, name, platform)
    for name, least in LEAST_TICK.items():
        if not number(mission, name, "apptick", least) >= least:
            yield f"{name} has AppTick {mission[name]['apptick']}: set it to {least:g} or more"


def _pid_faults(mission: Mission, name: str, platform: Platform) -> Iterator[str]:
    for key in ("tardy_helm_threshold", "tardy_nav_threshold"):
        if not SHORTEST_S <= number(mission, name, key, LONGEST_S) <= LONGEST_S:
            yield f"{name} has {key} {mission[name][key]}: set it to {LONGEST_S:g}"
    for key, needed in _gains(platform).items():
        value = number(mission, name, key, needed)
        if abs(value - needed) > GAIN_OFF * max(abs(needed), 1e-6):
            yield f"{name} has {key} {value:g} and platform {platform.name} {needed:g}: fit the platform, or set it"


def _hull_faults(mission: Mission, name: str, platform: Platform) -> Iterator[str]:
    """What the simulator does with a rudder and the platform does not, at top speed or at half of it."""
    if platform.kind != "usv":
        return
    rate, full_mps = min(number(mission, name, "turn_rate", TURN_RATE), MOST_TURN_RATE), SIMULATORS[name]
    for speed_mps in (platform.max_speed_mps, 0.5 * platform.max_speed_mps):
        theirs = rate * min(1.0, speed_mps / full_mps) if full_mps > 0.0 else rate
        ours = platform.turn_gain * platform.way_share(speed_mps)
        if not abs(ours - theirs) <= GAIN_OFF * theirs:
            yield (
                f"{name} turns this boat by {theirs:.3g} deg/s at {speed_mps:g} m/s and thrust 50, platform "
                f"{platform.name} by {ours:.3g}: give the platform turn_gain: {rate:g} and full_turn_speed_mps: "
                f"{full_mps:g}"
            )
            return


def _gains(platform: Platform) -> dict[str, float]:
    """What a PID's settings are to be, by name."""
    if platform.kind != "usv":
        return {}
    return {
        "yaw_pid_kp": platform.heading_pid.kp,
        "yaw_pid_kd": platform.heading_pid.kd,
        "speed_factor": platform.speed_factor,
        "maxrudder": platform.max_rudder,
        "maxthrust": platform.max_thrust,
    }
