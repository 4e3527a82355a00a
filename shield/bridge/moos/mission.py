"""What a boat's .moos file says that a MOOSDB does not: thresholds, ticks, prefix, gains."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from ...platforms import Platform

SHORTEST_S, LONGEST_S = 1.0, 2.0
"""Bounds of a PID's tardy thresholds: it must outlast two missed commands, and stop a boat whose gate died."""
PIDS, SIMULATORS = ("pMarinePID", "pMarinePIDV22"), ("uSimMarine", "uSimMarineV22", "uSimMarineV23")
LEAST_TICK = {**dict.fromkeys((*PIDS, *SIMULATORS), 5.0), "pHelmIvP": 2.0, "pNodeReporter": 2.0}
GAIN_OFF = 0.2
"""Share by which a PID's gains may differ from the platform's."""
_BLOCK = re.compile(r"ProcessConfig\s*=\s*(\w+)\s*\{([^}]*)\}", re.IGNORECASE)
_ENTRY = re.compile(r"^\s*([\w.]+)\s*=\s*(.*?)\s*(?://.*)?$")

Mission = dict[str, dict[str, str]]


def parse_mission(text: str) -> Mission:
    """Settings of each app of a .moos file, keys in lower case; those of the file itself under ''."""

    def entries(body: str) -> dict[str, str]:
        found = (_ENTRY.match(line) for line in body.splitlines())
        return {match[1].lower(): match[2] for match in found if match is not None}

    text = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("//"))
    return {"": entries(_BLOCK.sub("", text)), **{name: entries(body) for name, body in _BLOCK.findall(text)}}


def mission_faults(mission: Mission, port: int, warp: float, platform: Platform, gate: str, prefix: str) -> list[str]:
    """Everything in a boat's mission that would undo the shield, each with its remedy; ``port``: of its MOOSDB."""
    return list(_faults(mission, port, warp, platform, gate, prefix))


def number(mission: Mission, app: str, key: str, otherwise: float) -> float:
    """A number of a mission; NaN where it is none, which fits nowhere."""
    try:
        return float(mission.get(app, {}).get(key, otherwise))
    except ValueError:
        return math.nan


def _faults(mission: Mission, port: int, warp: float, platform: Platform, gate: str, prefix: str) -> Iterator[str]:
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
    for name, least in LEAST_TICK.items():
        if not number(mission, name, "apptick", least) >= least:
            yield f"{name} has AppTick {mission[name]['apptick']}: set it to {least:g} or more"


def _pid_faults(mission: Mission, name: str, platform: Platform) -> Iterator[str]:
    for key in ("tardy_helm_threshold", "tardy_nav_threshold"):
        if not SHORTEST_S <= number(mission, name, key, LONGEST_S) <= LONGEST_S:
            yield f"{name} has {key} {mission[name][key]}: set it to {LONGEST_S:g}"
    for key, wanted in _gains(platform).items():
        value = number(mission, name, key, wanted)
        if abs(value - wanted) > GAIN_OFF * max(abs(wanted), 1e-6):
            yield f"{name} has {key} {value:g} and platform {platform.name} {wanted:g}: fit the platform, or set it"


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
