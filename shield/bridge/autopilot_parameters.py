"""What of an autopilot's parameters must not be as it is; by the names of ArduPilot up to 4.6 and from 4.7 on.

A parameter that was not heard is taken to be absent: firmware has the one name or the other, and not every feature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..platforms import Platform

STANDARD_TIMEOUT_S = 3.0
TOP_SPEED_TOLERANCE = 1.02
GROUND_SYSTEM = 255.0  # our system id
NEEDED_CHECKS = {2: "compass", 3: "GPS", 4: "INS"}  # arming checks, by their bit, of what position and heading rest on
OBSTACLE_SENSORS = ("PRX1_TYPE", "PRX_TYPE")
AVOIDS = 3.0  # what Rover's AVOID_ENABLE is where nobody heard it: its default
ASKED = (
    "FS_GCS_ENABLE", "GUID_TIMEOUT", "SYSID_MYGCS", "SYSID_ENFORCE", "MAV_GCS_SYSID", "MAV_GCS_SYSID_HI", "MAV_OPTIONS",
    "ARMING_CHECK", "ARMING_SKIPCHK", "FENCE_ENABLE", "AVOID_ENABLE", *OBSTACLE_SENSORS, "BCN_TYPE",
    "OA_TYPE", "SAIL_ENABLE", "FS_ACTION", "BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT",
)  # fmt: skip
"""Parameters that are looked at here, besides WP_SPEED."""
FENCE_ASKED = ("FENCE_TYPE", "FENCE_RADIUS", "FENCE_MARGIN", "FENCE_ACTION", "AVOID_MARGIN")
"""Those of a fence that is on, see `fence`."""

HOLD = 2
SAILS = {1: "RTL", 3: "SmartRTL or RTL", 4: "SmartRTL or Hold", 6: "Loiter or Hold"}
"""Rover's answers to a fail-safe, and to its fence, in which the autopilot steers the boat by itself."""


def parameter_faults(known: Mapping[str, float], platform: Platform) -> list[str]:
    """Everything wrong with an autopilot's parameters, by name as heard, for a platform; each with its remedy."""
    top, timeout = known.get("WP_SPEED", math.nan), known.get("GUID_TIMEOUT", STANDARD_TIMEOUT_S)
    faults = [] if top > 0.0 else ["WP_SPEED is not known or 0: set it to the boat's top speed"]
    if 0.0 < top * TOP_SPEED_TOLERANCE < platform.max_speed_mps:
        faults.append(
            f"WP_SPEED {top:g} m/s is below the platform's {platform.max_speed_mps:g} m/s, so the boat is slower than "
            f"the shield thinks: set it to {platform.max_speed_mps:g}"
        )
    if not 0.0 < timeout <= STANDARD_TIMEOUT_S:
        faults.append(f"GUID_TIMEOUT is {timeout:g} s: set it to {STANDARD_TIMEOUT_S:g} or less")
    answers = (sails_by_itself(known, name) for name in ("FS_ACTION", "BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"))
    return [fault for fault in (*faults, _arming(known), _ground(known), *_changes(known), *answers) if fault]


def sails_by_itself(known: Mapping[str, float], name: str) -> str:
    """What is wrong with an answer of the autopilot that sails the boat past the shield; empty: it does not."""
    value = _bits(known, name, HOLD)
    if value not in SAILS:
        return ""
    return f"{name} is {value} ({SAILS[value]}), so the autopilot would sail among boats past the shield: set it to 2"


def _arming(known: Mapping[str, float]) -> str:
    """ARMING_CHECK holds the checks to make (bit 0: all of them), ARMING_SKIPCHK those to leave out."""
    made, skipped = _bits(known, "ARMING_CHECK", 1.0), _bits(known, "ARMING_SKIPCHK")
    if made == 0:
        return "ARMING_CHECK is 0, all checks off: set it to 1"
    if skipped < 0:
        return f"ARMING_SKIPCHK is {skipped}, all checks skipped: set it to 0"
    unmade = [name for bit, name in NEEDED_CHECKS.items() if not made & 1 and not made >> bit & 1]
    if unmade:
        return f"ARMING_CHECK {made} leaves {', '.join(unmade)} unchecked: set it to 1"
    left_out = [name for bit, name in NEEDED_CHECKS.items() if skipped >> bit & 1]
    return f"ARMING_SKIPCHK {skipped} leaves {', '.join(left_out)} unchecked: set it to 0" if left_out else ""


def _ground(known: Mapping[str, float]) -> str:
    """Whether the boat listens to our system id where it listens to one only, or fails safe without it."""
    enforced = known.get("SYSID_ENFORCE", 0.0) != 0.0 or bool(_bits(known, "MAV_OPTIONS") & 1)
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
    avoid, on = _bits(known, "AVOID_ENABLE", AVOIDS), {name for name, value in known.items() if value != 0.0}
    sensors = [name for name in OBSTACLE_SENSORS if name in on]
    found: dict[str, str] = {f"{name} is {known[name]:g}": name for name in ("OA_TYPE", "SAIL_ENABLE") if name in on}
    if avoid & 2 and sensors:
        found[f"AVOID_ENABLE has bit 1 and {sensors[0]} is on"] = "AVOID_ENABLE"
    if avoid & 4 and "BCN_TYPE" in on:
        found["AVOID_ENABLE has bit 2 and BCN_TYPE is on"] = "AVOID_ENABLE"
    return [
        f"{what}, so the autopilot changes commands after the shield: set {name} to 0" for what, name in found.items()
    ]


def _bits(known: Mapping[str, float], name: str, otherwise: float = 0.0) -> int:
    """A bit mask that came as a float; -1 has all bits."""
    value = known.get(name, otherwise)
    return int(value) if math.isfinite(value) else 0
