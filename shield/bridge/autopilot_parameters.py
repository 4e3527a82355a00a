"""What of an autopilot's parameters must not be as it is; by the names of ArduPilot up to 4.6 and from 4.7 on.

A parameter that was not heard is taken to be absent: firmware has the one name or the other, and not every feature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..platforms import Platform

STANDARD_TIMEOUT_S = 3.0
TOP_SPEED_TOLERANCE = 1.02
GROUND_SYSTEM = 255.0
"""Our system id."""

NEEDED_CHECKS = {2: "compass", 3: "GPS", 4: "INS"}
"""Arming checks, by their bit, of what position and heading rest on."""

OBSTACLE_SENSORS = ("PRX1_TYPE", "PRX_TYPE")
AVOIDS = 3.0
"""What Rover's AVOID_ENABLE is where nobody heard it: its default."""

ASKED = (
    "FS_GCS_ENABLE", "GUID_TIMEOUT", "SYSID_MYGCS", "SYSID_ENFORCE", "MAV_GCS_SYSID", "MAV_GCS_SYSID_HI", "MAV_OPTIONS",
    "ARMING_CHECK", "ARMING_SKIPCHK", "FENCE_ENABLE", "AVOID_ENABLE", *OBSTACLE_SENSORS, "BCN_TYPE",
    "OA_TYPE", "SAIL_ENABLE",
)  # fmt: skip
"""Parameters that are looked at here, besides WP_SPEED."""
FENCE_ASKED = ("FENCE_TYPE", "FENCE_RADIUS", "FENCE_MARGIN", "AVOID_MARGIN")
"""Those of a fence that is on, see `fence`."""


def parameter_faults(known: Mapping[str, float], platform: Platform) -> list[str]:
    """Everything wrong with an autopilot's parameters, each with its remedy.

    Args:
        known: parameters heard, by name.
        platform: of the boat.
    """
    faults = [_top_speed(known.get("WP_SPEED", math.nan), platform), _timeout(known)]
    faults += [_arming(known), _ground(known), *_changes(known)]
    return [fault for fault in faults if fault]


def _top_speed(top: float, platform: Platform) -> str:
    if not top > 0.0:
        return "WP_SPEED is not known or 0: set it to the boat's top speed"
    if top * TOP_SPEED_TOLERANCE < platform.max_speed_mps:
        return (
            f"WP_SPEED {top:g} m/s is below the platform's {platform.max_speed_mps:g} m/s, so the boat is slower than "
            f"the shield thinks: set it to {platform.max_speed_mps:g}"
        )
    return ""


def _timeout(known: Mapping[str, float]) -> str:
    timeout = known.get("GUID_TIMEOUT", STANDARD_TIMEOUT_S)
    return "" if 0.0 < timeout <= STANDARD_TIMEOUT_S else (
        f"GUID_TIMEOUT is {timeout:g} s: set it to {STANDARD_TIMEOUT_S:g} or less"
    )  # fmt: skip


def _arming(known: Mapping[str, float]) -> str:
    """ARMING_CHECK holds the checks to make (bit 0: all of them), ARMING_SKIPCHK those to leave out."""
    if known.get("ARMING_CHECK", 1.0) == 0.0:
        return "ARMING_CHECK is 0, all checks off: set it to 1"
    made, skipped = _bits(known.get("ARMING_CHECK", 1.0)), _bits(known.get("ARMING_SKIPCHK", 0.0))
    if known.get("ARMING_SKIPCHK", 0.0) < 0.0:
        return f"ARMING_SKIPCHK is {known['ARMING_SKIPCHK']:g}, all checks skipped: set it to 0"
    left_out = [name for bit, name in NEEDED_CHECKS.items() if not made & 1 and not made >> bit & 1]
    if left_out:
        return f"ARMING_CHECK {made} leaves {', '.join(left_out)} unchecked: set it to 1"
    left_out = [name for bit, name in NEEDED_CHECKS.items() if skipped >> bit & 1]
    return f"ARMING_SKIPCHK {skipped} leaves {', '.join(left_out)} unchecked: set it to 0" if left_out else ""


def _ground(known: Mapping[str, float]) -> str:
    """Whether the boat listens to our system id where it listens to one only, or fails safe without it."""
    enforced = known.get("SYSID_ENFORCE", 0.0) != 0.0 or bool(_bits(known.get("MAV_OPTIONS", 0.0)) & 1)
    if not (enforced or known.get("FS_GCS_ENABLE", 0.0) != 0.0):
        return ""
    for name in ("SYSID_MYGCS", "MAV_GCS_SYSID"):
        low = known.get(name, GROUND_SYSTEM)
        high = max(low, known.get("MAV_GCS_SYSID_HI", low) if name == "MAV_GCS_SYSID" else low)
        if not low <= GROUND_SYSTEM <= high:
            return f"{name} is {low:g} and ours is {GROUND_SYSTEM:g}: set it to {GROUND_SYSTEM:g}"
    return ""


def _changes(known: Mapping[str, float]) -> list[str]:
    """What in the autopilot changes a command after the shield, or takes the boat away from it."""
    faults = []
    avoid = _bits(known.get("AVOID_ENABLE", AVOIDS))
    sensors = [name for name in OBSTACLE_SENSORS if known.get(name, 0.0) != 0.0]
    if avoid & 2 and sensors:
        faults.append(_after(f"AVOID_ENABLE has bit 1 and {sensors[0]} is on", "AVOID_ENABLE"))
    if avoid & 4 and known.get("BCN_TYPE", 0.0) != 0.0:
        faults.append(_after("AVOID_ENABLE has bit 2 and BCN_TYPE is on", "AVOID_ENABLE"))
    faults += [
        _after(f"{name} is {known[name]:g}", name) for name in ("OA_TYPE", "SAIL_ENABLE") if known.get(name, 0.0) != 0.0
    ]
    return faults


def _after(what: str, name: str) -> str:
    return f"{what}, so the autopilot changes commands after the shield: set {name} to 0"


def _bits(value: float) -> int:
    """A bit mask that came as a float; -1 has all bits."""
    return int(value) if math.isfinite(value) else 0
