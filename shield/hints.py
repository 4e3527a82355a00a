"""Words about what is taken, but looks like a mistake of units: said once, with the call that is right."""

from __future__ import annotations

import logging

import numpy as np

from .jit import Array

_LOG = logging.getLogger(__name__)

MOST_RAD = 10.0
"""Headings beyond this are hardly radians: a heading of a turn and a half, plus rounding."""

SMALLEST_FLEET_M = 0.05
"""Boats that are all within so much of each other, and not at one point, are hardly given in metres."""

MOST_ERROR_M = 50.0
"""Bounds on a position's error beyond this are hardly metres: nobody can keep clear of such a boat."""

_said: set[str] = set()


def say_once(topic: str, words: str) -> None:
    """Log a warning, the first time a topic comes up in this process."""
    if topic not in _said:
        _said.add(topic)
        _LOG.warning(words)


def hint_at_headings(what: str, heading_rad: Array, remedy: str) -> None:
    """Say so if headings in rad look like degrees."""
    largest = np.abs(heading_rad).max(initial=0.0, where=np.isfinite(heading_rad))
    if largest > MOST_RAD:
        say_once(
            what, f"{what} holds {largest:g} rad, {largest / (2.0 * np.pi):.3g} turns; if these are degrees {remedy}"
        )


def hint_at_positions(position_m: Array) -> None:
    """Say so if positions in m look like degrees of longitude and latitude."""
    if len(position_m) < 2 or not np.isfinite(position_m).all():
        return
    spread = float(np.ptp(position_m, axis=0).max())
    if 0.0 < spread < SMALLEST_FLEET_M and (np.abs(position_m) <= 180.0).all():
        say_once(
            "position_m",
            f"all {len(position_m)} boats are within {spread:.2g} m of each other; if these are degrees, give metres "
            "east and north of a place nearby: steerclear.shield.bridge.frame.FieldFrame(latitude_deg, longitude_deg)"
            ".to_field_m(latitude_deg, longitude_deg)",
        )


def hint_at_errors(position_error_m: Array) -> None:
    """Say so if bounds on position errors, m, look like mm or cm."""
    largest = position_error_m.max(initial=0.0)
    if largest > MOST_ERROR_M:
        say_once(
            "position_error_m",
            f"position_error_m holds {largest:g} m; if that is mm, divide by 1000. The separation is widened by the "
            "errors of both boats, so that every boat nearby will seem too near",
        )


def hint_at_speed(boat: str, speed_mps: float, highest_mps: float) -> None:
    """Say that a wanted speed is cut, and how rows are read."""
    say_once(
        "speed",
        f"a speed of {speed_mps:g} m/s is wanted of boat {boat!r}, whose platform does 0 to "
        f"{highest_mps:g} m/s; it is cut to that (reason LIMITED). Rows are (speed m/s, heading), in this order",
    )
