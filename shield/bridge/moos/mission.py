"""What a boat's .moos file says that a MOOSDB does not: thresholds, ticks, prefix, gains."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path

from ...platforms import Platform

SHORTEST_S, LONGEST_S = 1.0, 2.0
"""Bounds of a PID's tardy thresholds: it must outlast two missed commands, and stop a boat whose gate died."""
LEAST_TICK = {"pMarinePID": 5.0, "pMarinePIDV22": 5.0, "pHelmIvP": 2.0, "pNodeReporter": 2.0}
SIMULATORS = ("uSimMarine", "uSimMarineV22", "uSimMarineV23")
GAIN_OFF = 0.2
"""Share by which a PID's gains may differ from the platform's."""
_BLOCK = re.compile(r"ProcessConfig\s*=\s*(\w+)\s*\{([^}]*)\}", re.IGNORECASE)
_ENTRY = re.compile(r"^\s*([\w.]+)\s*=\s*(.*?)\s*(?://.*)?$")

Mission = dict[str, dict[str, str]]


def parse_mission(text: str) -> Mission:
    """Settings of each app of a .moos file, keys in lower case; those of the file itself under ''."""
    text = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("//"))
    mission = {name: _entries(body) for name, body in _BLOCK.findall(text)}
    return {"": _entries(_BLOCK.sub("", text)), **mission}


def read_mission(path: Path) -> Mission:
    """A .moos file.

    Raises:
        OSError: it cannot be read.
        ValueError: it holds no text.
    """
    return parse_mission(path.read_text(encoding="utf-8"))


def mission_faults(mission: Mission, port: int, warp: float, platform: Platform, gate: str, prefix: str) -> list[str]:
    """Everything in a mission that would undo the shield, each with its remedy.

    Args:
        mission: of the boat.
        port: at which its MOOSDB is to be.
        warp: of this run.
        platform: of the boat.
        gate: "helm" or "pid".
        prefix: what the helm is to put before its DESIRED_*.
    """
    top = mission.get("", {})
    faults = []
    if int(_number(top, "serverport", port)) != port:
        faults.append(f"ServerPort is {top['serverport']} and the link's port {port}: give both the same")
    if not math.isclose(_number(top, "moostimewarp", 1.0), warp):
        faults.append(
            f"MOOSTimeWarp is {top.get('moostimewarp', '1')} and this run's --speed {warp:g}: give both the same"
        )
    helm = mission.get("pHelmIvP")
    if helm is not None and gate == "helm" and helm.get("helm_prefix", "") != prefix:
        faults.append(f"pHelmIvP writes DESIRED_* itself: set helm_prefix = {prefix}")
    if helm is not None and helm.get("allow_override", "true").lower() == "false":
        faults.append("pHelmIvP has allow_override = false, so nobody can take the boat by hand: set it to true")
    pids: list[str] = [name for name in ("pMarinePID", "pMarinePIDV22") if name in mission]
    if len(pids) != 1:
        faults.append(f"{len(pids)} PIDs are configured: have one of pMarinePID and pMarinePIDV22")
    for name in pids:
        faults += _pid_faults(name, mission[name], platform)
    for name, least in LEAST_TICK.items():
        if name in mission and _number(mission[name], "apptick", 5.0) < least:
            faults.append(f"{name} has AppTick {mission[name]['apptick']}: set it to {least:g} or more")
    for name in SIMULATORS:
        if name in mission and _number(mission[name], "apptick", 5.0) < 5.0:
            faults.append(f"{name} has AppTick {mission[name]['apptick']}, so NAV_* come too seldom: set it to 10")
    return faults


def _pid_faults(name: str, pid: Mapping[str, str], platform: Platform) -> list[str]:
    faults = []
    for key in ("tardy_helm_threshold", "tardy_nav_threshold"):
        seconds = _number(pid, key, 2.0)
        if not SHORTEST_S <= seconds <= LONGEST_S:
            faults.append(f"{name} has {key} {pid.get(key)}: set it to {LONGEST_S:g}")
    gains = (
        ("yaw_pid_kp", platform.heading_pid.kp),
        ("yaw_pid_kd", platform.heading_pid.kd),
        ("speed_factor", platform.speed_factor),
        ("maxrudder", platform.max_rudder),
        ("maxthrust", platform.max_thrust),
    )
    for key, wanted in gains if platform.kind == "usv" else ():
        value = _number(pid, key, math.nan)
        if math.isfinite(value) and abs(value - wanted) > GAIN_OFF * max(abs(wanted), 1e-6):
            faults.append(
                f"{name} has {key} {value:g} and platform {platform.name} {wanted:g}: fit the platform, or set it"
            )
    return faults


def _entries(text: str) -> dict[str, str]:
    found = (_ENTRY.match(line) for line in text.splitlines())
    return {match[1].lower(): match[2] for match in found if match is not None}


def _number(entries: Mapping[str, str], key: str, otherwise: float) -> float:
    """A number of a mission; NaN where it is none, which fits nowhere."""
    try:
        return float(entries[key]) if key in entries else otherwise
    except ValueError:
        return math.nan
