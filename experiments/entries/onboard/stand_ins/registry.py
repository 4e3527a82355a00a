"""The boats of the game that the zip was made for, by name, from a file beside this one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms.platform import Gains, Platform
from steerclear.shield.platforms.proving import reference_models


def _platform(entries: dict[str, Any]) -> Platform:
    pids: dict[str, Any] = {name: Gains(**entries.pop(name)) for name in ("speed_pid", "heading_pid")}
    points = tuple(tuple(point) for point in entries.pop("thrust_map"))
    return Platform(thrust_map=points, **pids, **entries)


with reference_models():  # those who packed them have tried them
    _TEXT = (Path(__file__).parent / "platforms.json").read_text()
    PLATFORMS: dict[str, Platform] = {entries["name"]: _platform(entries) for entries in json.loads(_TEXT)}


def get_platform(name: str | Platform) -> Platform:
    """The platform of that name; a `Platform` passes through."""
    if isinstance(name, Platform):
        return name
    if name not in PLATFORMS:
        raise PlatformError(f"unknown platform {name!r}; packed are {', '.join(sorted(PLATFORMS))}")
    return PLATFORMS[name]


def known_platforms() -> dict[str, Platform]:
    """Those that are packed, by name."""
    return dict(PLATFORMS)


def register_platform(platform: Any) -> Any:
    """Refuse it: what is packed is what the zip was made for."""
    raise PlatformError("a shielded zip knows the boats it was packed with; wrap the entry anew with other ones")
