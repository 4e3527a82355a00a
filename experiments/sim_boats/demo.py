"""The packaged fleet file, and boats that differ from their declared platforms."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from importlib import resources
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from steerclear.shield.bridge.fleet_file import FleetFile, parse_fleet
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Gains, Platform

KEPT = ("name", "kind", "max_speed_mps", "thrust_map", "max_thrust", "max_rudder", "speed_gain", "speed_pid")
"""Unchanged platform fields: names, top speed and the scales of the other values."""
LARGEST = 0.9


def off_platform(platform: Platform, share: float, boat: str, seed: int) -> Platform:
    """Return the platform with each parameter increased or decreased by a share.

    Args:
        platform: as declared.
        share: 0.2 changes each by 20 %.
        boat: its name; every boat draws its own signs.
        seed: of the draw.

    Raises:
        ConfigError: the share is out of range.
        PlatformError: the resulting boat cannot be steered.
    """
    if not 0.0 <= share <= LARGEST:
        raise ConfigError(f"off is {share:g}; give a share from 0 to {LARGEST:g}, such as 0.2")
    if share == 0.0:
        return platform
    rng = np.random.default_rng([seed, crc32(boat.encode())])

    def off(value: float) -> float:
        return value * (1.0 + share * float(rng.choice((-1.0, 1.0))))

    changed: dict[str, Any] = {}
    for name in (entry.name for entry in fields(Platform) if entry.name not in KEPT):
        value = getattr(platform, name)
        is_pid = isinstance(value, Gains)
        changed[name] = replace(value, kp=off(value.kp), kd=off(value.kd)) if is_pid else off(float(value))
    changed["turn_loss"] = min(1.0, float(changed["turn_loss"]))
    return replace(platform, name=f"{platform.name}_off", **changed)


NAME = "demo_fleet.yaml"
LINKS = ("mavlink", "moos")
MOOS_PORTS = (9001, 9002, 9003)  # ports of the own boats' MOOSDBs in the file for MOOS


def demo_text(link: str = "mavlink") -> str:
    """Return the packaged file's text, as a template.

    Args:
        link: what the own boats run, one of `LINKS`.

    Raises:
        ConfigError: another link.
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
    """Return the parsed packaged file; relative paths start from the current folder."""
    return parse_fleet(demo_text(link), NAME, Path.cwd())
