"""The black box of a run."""

from __future__ import annotations

from collections.abc import Sequence

from steerclear.shield.bridge.blackbox import McapWriter, header_of_fleet, log_path
from steerclear.shield.bridge.preflight_checks import CheckResult
from steerclear.shield.bridge.session import VehicleSession


def open_box(station: VehicleSession, text: str, policy: str, checks: Sequence[CheckResult]) -> McapWriter:
    """Begin a log of what a station does.

    Args:
        station: with its file and links.
        text: of the fleet file.
        policy: name of what steers.
        checks: results so far; those not passed were accepted and are noted.

    Raises:
        BridgeError: the log cannot be begun.
    """
    header = header_of_fleet(
        station.fleet,
        text,
        policy=policy,
        commanded=station.links,
        clock_s=station.clock.now_s(),
        notes={f"accepted {result.name}": result.text for result in checks if not result.passed},
    )
    return McapWriter(log_path(station.fleet.log_dir, ".mcap", station.begun_unix_s), header, key=station.key)
