"""The fleet file that comes with the package: three of our boats against three others, on this machine."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

from steerclear.shield.bridge.fleet_file import FleetFile, parse_fleet
from steerclear.shield.exceptions import ConfigError

NAME = "demo_fleet.yaml"


LINKS = ("mavlink", "moos")
MOOS_PORTS = (9001, 9002, 9003)
"""Ports of our boats' MOOSDBs in the file of boats that run MOOS."""


def demo_text(link: str = "mavlink") -> str:
    """The file's text, to begin one's own with.

    Args:
        link: what our boats run, one of `LINKS`.

    Raises:
        ConfigError: another.
    """
    text = resources.files("steerclear.experiments").joinpath("templates", NAME).read_text(encoding="utf-8")
    if link not in LINKS:
        raise ConfigError(f"--link is {link!r}; choose one of {', '.join(LINKS)}")
    if link == "moos":
        ports = iter(MOOS_PORTS)
        text = re.sub(r"link: \{kind: mavlink[^}]*\}", lambda _: f'link: "moos://127.0.0.1:{next(ports)}"', text)
        text = text.replace("contact: feed", "contact: moos")
    return text


def demo_fleet(link: str = "mavlink") -> FleetFile:
    """The file, read; its relative paths start from the present folder."""
    return parse_fleet(demo_text(link), NAME, Path.cwd())
