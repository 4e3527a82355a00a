"""The fleet file that comes with the package: three of our boats against three others, on this machine."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from steerclear.shield.bridge.fleet_file import FleetFile, parse_fleet

NAME = "demo_fleet.yaml"


def demo_text() -> str:
    """The file's text, to begin one's own with."""
    return resources.files("steerclear.experiments.report").joinpath("templates", NAME).read_text(encoding="utf-8")


def demo_fleet() -> FleetFile:
    """The file, read; its relative paths start from the present folder."""
    return parse_fleet(demo_text(), NAME, Path.cwd())
